// Which runs are lent to the cards of a worker, and what is learnt of their speed.

#include "core/microscope/campaign/microscope_campaign.hpp"
#include "tests/coordinator/dispatch/dispatch_fixture.hpp"

namespace proofmass::test {
namespace {

/// A worker with 16 slots of processors and some of cards.
class CardTest : public DispatchFixture {
 protected:
  void add_worker_with_cards(WorkerId id, std::uint32_t num_card_slots) {
    proto::Hello with_cards = hello(16 + num_card_slots);
    with_cards.set_num_card_slots(num_card_slots);
    say_hello(id, with_cards);
    outbox.forget();
    heartbeat(id);
  }
};

TEST_F(CardTest, LendsToCardsWhatIdleProcessorsHaveNoRoomFor) {
  add_worker_with_cards(first, 1000);
  add_campaign(one, 16);
  EXPECT_FALSE(outbox.take_sent<proto::RunLease>(first).is_for_cards());
  add_campaign(two, 300);
  const auto lease = outbox.take_sent<proto::RunLease>(first);
  EXPECT_TRUE(lease.is_for_cards());
  EXPECT_GT(lease.num_runs(), 290U);
  outbox.forget();
}

TEST_F(CardTest, AsksForAllThatIsForCardsOnceProcessorsHaveComputedSome) {
  add_worker_with_cards(first, 1000);
  add_campaign(one, 500);
  const auto for_processors = outbox.take_sent<proto::RunLease>(first);
  const auto for_cards = outbox.take_sent<proto::RunLease>(first);
  ASSERT_TRUE(for_cards.is_for_cards());
  deliver(first, one, {for_processors.first_run()});
  outbox.forget();
  EXPECT_TRUE(state.workers.at(first).card_work.at(one).can_compute);

  deliver(first, one, {for_cards.first_run()});
  const auto retract = outbox.take_sent<proto::Retract>(first);
  EXPECT_EQ(retract.ranges(0).count(), for_cards.num_runs() - 1);
  outbox.forget();
  EXPECT_FALSE(state.workers.at(first).card_work.at(one).can_compute);
  const RunRange others{{for_cards.first_run() + 1}, for_cards.num_runs() - 1};
  give_back(first, held(one, others));
  outbox.forget();
  EXPECT_EQ(state.workers.at(first).num_lent_to_cards, 0U);
  EXPECT_LE(state.workers.at(first).num_lent, 32U) << "two rounds of its processors";
}

TEST_F(CardTest, MeasuresACardWhileItIsBusy) {
  add_worker_with_cards(first, 1000);
  add_campaign(one, 5000);
  outbox.take_sent<proto::RunLease>(first);
  const auto for_cards = outbox.take_sent<proto::RunLease>(first);
  outbox.forget();
  const auto deliver_from_card = [&](std::uint64_t begin, std::uint64_t end) {
    std::vector<wire::ComputedRun> results;
    for (std::uint64_t run = begin; run < end; ++run) {
      results.push_back(computed(run));
      results.back().is_by_card = true;
    }
    on_results(state, first, one, {1}, std::move(results), now, outbox);
    outbox.forget();
  };
  now += std::chrono::seconds(4);
  deliver_from_card(for_cards.first_run(), for_cards.first_run() + 200);
  EXPECT_DOUBLE_EQ(state.workers.at(first).card_work.at(one).rate, 50.0);
  now += std::chrono::seconds(2);
  deliver_from_card(for_cards.first_run() + 200, for_cards.first_run() + 330);
  EXPECT_DOUBLE_EQ(state.workers.at(first).card_work.at(one).rate, 55.0);
}

// By its speed the card has what it holds for ten seconds; a run of a processor takes one.
TEST_F(CardTest, CopiesWhatACardHasForTwiceAsLongAsItShould) {
  add_worker_with_cards(first, 1000);
  add_campaign(one, 500);
  const auto for_processors = outbox.take_sent<proto::RunLease>(first);
  ASSERT_TRUE(outbox.take_sent<proto::RunLease>(first).is_for_cards());
  for (std::uint64_t run = 0; run < for_processors.num_runs(); ++run) complete(first, one, {run});
  campaign(one).run_time_s = 1.0;
  const coordinator::Worker& worker = state.workers.at(first);
  ASSERT_EQ(worker.num_lent, worker.num_lent_to_cards) << "only the cards have runs";
  state.workers.at(first).card_work.at(one).rate = static_cast<double>(worker.num_lent) / 10.0;
  heartbeat(first, {held(one, {{for_processors.num_runs()}, worker.num_lent})},
            {make_computed_batch(one, {{RunIndex{for_processors.num_runs()}, worker.num_lent}})});
  add_busy_worker(second, 16, "other");
  const auto has_copies_after = [&](int wait_s) {
    now += std::chrono::seconds(wait_s);
    for (const WorkerId id : {first, second}) state.workers.at(id).heard_at = now;
    on_tick(state, now, outbox);
    const bool has_copies = outbox.num_sent() > 0;
    outbox.forget();
    return has_copies;
  };
  EXPECT_FALSE(has_copies_after(19));
  EXPECT_TRUE(has_copies_after(2));
}

}  // namespace
}  // namespace proofmass::test
