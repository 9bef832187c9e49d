#include "coordinator/factory/carry_out.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <vector>

namespace proofmass::coordinator {
namespace {

using testing::ElementsAre;

/// A batch system that runs what it is handed: an identifier is a line of sh that cancels it.
class CarryOut : public testing::Test {
 protected:
  void carry_out(const FactoryActions& actions) {
    coordinator::carry_out(actions, state_, system_, allocation_,
                           [this](const wire::Event& event) { events_.push_back(to_text(event)); });
  }

  BatchSystem system_{.name = "sh",
                      .submission =
                          [](const AllocationConfig& config) {
                            return BatchCommand{{"sh", "-c", config.worker_command}};
                          },
                      .id_of = [](std::string_view output) { return std::string(output); },
                      .listing = nullptr,
                      .allocations_of = nullptr,
                      .cancellation =
                          [](const std::string& id) {
                            return BatchCommand{{"sh", "-c", id}};
                          }};
  AllocationConfig allocation_{
      .name = "fleet", .worker_command = "printf 17", .num_processors = {}, .options = {}};
  FactoryState state_;
  std::vector<std::string> events_;
};

TEST_F(CarryOut, GoesOnAfterACancellationThatFails) {
  carry_out({.num_submissions = 1, .cancelled = {"echo Unknown Job Id >&2; exit 153", "true"}});
  EXPECT_THAT(events_, ElementsAre("cancellation_failed allocation=\"echo Unknown Job Id >&2; exit "
                                   "153\" reason=\"sh: exit code 153: Unknown Job Id\"",
                                   "allocation_cancelled allocation=true",
                                   "worker_requested allocation=17"));
  EXPECT_TRUE(state_.allocations.contains("17"));
}

TEST_F(CarryOut, TriesNoFurtherSubmissionAfterOneThatFails) {
  allocation_.worker_command = "echo queue full >&2; exit 1";
  carry_out({.num_submissions = 3, .cancelled = {}});
  EXPECT_THAT(events_, ElementsAre("submission_failed retry_min=1 "
                                   "reason=\"sh: exit code 1: queue full\""));
  EXPECT_EQ(state_.num_failed_submissions, 1);
}

}  // namespace
}  // namespace proofmass::coordinator
