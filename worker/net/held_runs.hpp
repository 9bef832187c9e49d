#pragma once

#include <compare>
#include <cstddef>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "proto/proofmass.pb.h"
#include "proto/wire/messages.hpp"
#include "worker/execution/execution.hpp"

namespace proofmass::worker {

/// A run that the worker holds, ordered as messages name them.
struct HeldRun {
  wire::CampaignId campaign;
  wire::Attempt attempt;
  RunIndex run;

  auto operator<=>(const HeldRun&) const = default;
};

using HeldRunsList = google::protobuf::RepeatedPtrField<proto::HeldRuns>;

/// Runs by campaign and attempt, with the first `num_ranges_max` of their ranges.
/// @param runs  In any order, each once.
[[nodiscard]] HeldRunsList grouped(std::vector<HeldRun> runs, std::size_t num_ranges_max);

/// Number of ranges of all of them together.
[[nodiscard]] std::size_t num_ranges(const HeldRunsList& held);

/// Results that the coordinator has not acknowledged. They are sent again and again, at growing
/// intervals, until they are dropped.
class UnacknowledgedResults {
 public:
  /// @param resend_after, resend_after_max  From one time that a result is sent to the next:
  /// doubles
  ///                                        from the first to the second.
  UnacknowledgedResults(Duration resend_after, Duration resend_after_max)
      : resend_after_(resend_after), resend_after_max_(resend_after_max) {}

  /// @param due_at  When to send it for the first time.
  void add(wire::LeasedResult result, TimePoint due_at);

  /// Drops those of the results that are here.
  void drop(wire::CampaignId campaign, std::span<const RunIndex> runs);
  /// @return Number of results that were dropped.
  std::size_t drop(wire::CampaignId campaign, RunRange runs);

  /// The coordinator cannot take these results now. They stay, and are sent again when they are
  /// due.
  /// @return Number of results that were not set aside before.
  std::size_t set_aside(wire::CampaignId campaign, std::span<const RunRange> ranges);

  /// All results are to be sent at once, and then again as if for the first time.
  void make_due(TimePoint now);
  /// The results that are due, as messages; one message's worth of them at most.
  [[nodiscard]] std::vector<proto::ResultBatch> take_due(TimePoint now);
  /// These results as messages. @pre All of them are here.
  [[nodiscard]] std::vector<proto::ResultBatch> take(std::span<const RunKey> runs, TimePoint now);

  [[nodiscard]] bool contains(const RunKey& run) const { return results_.contains(run); }
  [[nodiscard]] bool empty() const { return results_.empty(); }
  [[nodiscard]] std::size_t size() const { return results_.size(); }
  /// Those that the coordinator could not take: it does not serve their campaigns.
  [[nodiscard]] std::size_t num_set_aside() const { return num_set_aside_; }

  /// In order of campaign and run.
  [[nodiscard]] std::vector<wire::LeasedResult> all() const;
  /// Adds the runs of the results to one of two lists.
  void list(std::vector<HeldRun>& held, std::vector<HeldRun>& set_aside) const;

 private:
  struct Kept {
    wire::LeasedResult result;
    TimePoint due_at;       ///< When to send it (again).
    Duration resend_after;  ///< From then on.
    bool is_set_aside = false;
  };
  using Results = std::map<RunKey, Kept>;

  Results::iterator drop(Results::iterator result);

  Duration resend_after_;
  Duration resend_after_max_;
  Results results_;
  std::size_t num_set_aside_ = 0;
};

}  // namespace proofmass::worker
