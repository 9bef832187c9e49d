// Files whose content no program of ours wrote: each is refused with a StoreError, or carried on
// with, and none ends the process.

#include <gmock/gmock.h>

#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using test::deliveries_of;
using test::delivery_of;
using test::store_error_of;
using test::write;
using ::testing::HasSubstr;

using StoreDamage = test::StoreTest;

TEST_F(StoreDamage, TimesThatAddUpToInfinityAreRefusedOneByOne) {
  Store store = create();
  Delivery delivery = delivery_of(0);
  for (const double compute_s : {1.7e308, -1.0, 1.1e9}) {
    delivery.compute_s = compute_s;
    EXPECT_THAT(store_error_of([&] { write(store, {delivery}); }),
                HasSubstr("(must be in [0, 1e9]; run 0)"));
  }
  delivery.compute_s = 1e9;
  EXPECT_EQ(write(store, {delivery}).num_new, 1u);
}

// A file from before times were bounded.
TEST_F(StoreDamage, AnInfiniteTimeOfAWorkerEndsNothing) {
  { create().commit(deliveries_of(0, 2)); }
  change("UPDATE worker SET compute_s = 9e999");
  Store store = Store::open(file());
  EXPECT_EQ(store.commit(deliveries_of(2, 4)).num_new, 2u);
  // No number in the file stays infinite.
  EXPECT_EQ(text("SELECT max(compute_s) FROM worker"), "1.0e+15");
  EXPECT_THAT(store_error_of([&] { store.check_integrity(); }),
              HasSubstr("is damaged: worker.compute_s"));
}

// Somebody deletes rows while a coordinator has the file.
TEST_F(StoreDamage, ARowThatIsDeletedMeanwhileIsMissedWhenItIsNeeded) {
  Store store = create();
  store.commit(deliveries_of(0, 4));
  change("DELETE FROM run_result WHERE run_index = 3");
  EXPECT_THAT(store_error_of([&] { write(store, {SecondDelivery{delivery_of(3)}}); }),
              HasSubstr("is damaged: run_result lacks run 3"));
  EXPECT_THAT(store_error_of([&] { store.check_integrity(); }), HasSubstr("is damaged: "));
  change("DELETE FROM delivery WHERE run_index = 2");
  EXPECT_THAT(store_error_of([&] { store.commit(deliveries_of(2, 3)); }),
              HasSubstr("is damaged: delivery lacks run 2, which has a result"));
  store.commit(deliveries_of(4, 5));
  change("DELETE FROM worker");
  const std::vector<Entry> wrong{SecondDelivery{test::wrong_delivery_of(1)}};
  EXPECT_NE(store_error_of([&] { write(store, wrong); }), "");
  EXPECT_EQ(write(store, wrong).num_contradicting, 1u) << "of a worker that is made anew";
  EXPECT_EQ(store.commit(deliveries_of(5, 7)).num_new, 2u);
}

TEST_F(StoreDamage, AFileWithoutItsCampaignIsRefusedByEveryFunction) {
  Store store = create();
  change("DELETE FROM campaign");
  for (const std::function<void()>& action : {std::function<void()>([&] { (void)store.id(); }),
                                              {[&] { (void)store.name(); }},
                                              {[&] { (void)store.num_runs(); }},
                                              {[&] { (void)store.control(); }},
                                              {[&] { (void)store.stop_plan(); }}}) {
    EXPECT_THAT(store_error_of(action), HasSubstr("is damaged"));
  }
}

}  // namespace
}  // namespace proofmass::coordinator
