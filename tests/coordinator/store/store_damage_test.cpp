// Files whose content no program of ours wrote: each is refused with a StoreError, or carried on
// with, and none ends the process.

#include <gmock/gmock.h>

#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using test::campaign_of;
using test::deliveries_of;
using test::delivery_of;
using test::store_error_of;
using ::testing::HasSubstr;

using StoreDamage = test::StoreTest;

TEST_F(StoreDamage, TimesThatAddUpToInfinityAreRefusedOneByOne) {
  Store store = Store::create(file(), campaign_of(10), "");
  Delivery delivery = delivery_of(0);
  for (const double compute_s : {1.7e308, -1.0, 1.1e9}) {
    delivery.compute_s = compute_s;
    EXPECT_THAT(store_error_of([&] {
                  store.commit({&delivery, 1});
                }),
                HasSubstr("(must be in [0, 1e9]; run 0)"));
  }
  delivery.compute_s = 1e9;
  EXPECT_EQ(store.commit({&delivery, 1}).num_new, 1u);
}

// A file from before times were bounded.
TEST_F(StoreDamage, AnInfiniteTimeOfAWorkerEndsNothing) {
  { Store::create(file(), campaign_of(10), "").commit(deliveries_of(0, 2)); }
  test::change(file(), "UPDATE worker SET compute_s = 9e999");
  Store store = Store::open(file());
  EXPECT_EQ(store.commit(deliveries_of(2, 4)).num_new, 2u);
  // No number in the file stays infinite.
  EXPECT_EQ(test::text_in(file(), "SELECT max(compute_s) FROM worker"), "1.0e+15");
  EXPECT_THAT(store_error_of([&] { store.check_integrity(); }),
              HasSubstr("is damaged: worker.compute_s"));
}

TEST_F(StoreDamage, ANumberBeyond32BitsIsNoCount) {
  { Store::create(file(), campaign_of(10), "").commit(deliveries_of(0, 2)); }
  test::change(file(),
               "UPDATE run_result SET num_draws = num_draws + (1 << 32) WHERE run_index = 1");
  const Store store = Store::open_read_only(file());
  EXPECT_THAT(store_error_of([&] { store.for_each_result([](const RunResult&) {}); }),
              HasSubstr("is damaged: num_draws = 4294967298 of run 1"));
}

TEST_F(StoreDamage, ASecondResultOfARunThatIsNotThereIsRefused) {
  Store store = Store::create(file(), campaign_of(10), "");
  const Entry second = SecondDelivery{delivery_of(3)};
  EXPECT_THAT(store_error_of([&] {
                store.write({&second, 1});
              }),
              HasSubstr("is damaged: run_result lacks run 3"));
}

// Somebody deletes rows while a coordinator has the file.
TEST_F(StoreDamage, AResultThatIsDeletedMeanwhileIsMissedWhenItIsNeeded) {
  Store store = Store::create(file(), campaign_of(10), "");
  store.commit(deliveries_of(0, 4));
  test::change(file(), "DELETE FROM run_result WHERE run_index = 3");
  const Entry second = SecondDelivery{delivery_of(3)};
  EXPECT_THAT(store_error_of([&] {
                store.write({&second, 1});
              }),
              HasSubstr("is damaged: run_result lacks run 3"));
  EXPECT_THAT(store_error_of([&] { store.check_integrity(); }), HasSubstr("is damaged: "));
  EXPECT_EQ(store.commit(deliveries_of(5, 7)).num_new, 2u);
}

TEST_F(StoreDamage, ADeliveryThatIsDeletedMeanwhileIsMissedWhenItsRunComesAgain) {
  Store store = Store::create(file(), campaign_of(10), "");
  store.commit(deliveries_of(0, 4));
  test::change(file(), "DELETE FROM delivery WHERE run_index = 3");
  EXPECT_THAT(store_error_of([&] { store.commit(deliveries_of(3, 4)); }),
              HasSubstr("is damaged: delivery lacks run 3, which has a result"));
  EXPECT_EQ(store.commit(deliveries_of(5, 7)).num_new, 2u);
}

TEST_F(StoreDamage, AWorkerThatIsDeletedMeanwhileIsRefusedAndMadeAnew) {
  Store store = Store::create(file(), campaign_of(10), "");
  store.commit(deliveries_of(0, 4));
  test::change(file(), "DELETE FROM worker");
  const Entry wrong = SecondDelivery{test::wrong_delivery_of(3)};
  EXPECT_NE(store_error_of([&] { store.write({&wrong, 1}); }), "");
  EXPECT_EQ(store.write({&wrong, 1}).num_contradicting, 1u);
}

TEST_F(StoreDamage, AFileWithoutItsCampaignIsRefusedByEveryFunction) {
  Store store = Store::create(file(), campaign_of(10), "");
  test::change(file(), "DELETE FROM campaign");
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
