#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/campaign/campaign.hpp"
#include "core/campaign/definition.hpp"
#include "core/model.hpp"
#include "proto/wire/messages.hpp"

namespace proofmass::proto {
class RunLease;
}  // namespace proofmass::proto

namespace proofmass::worker {

/// A monotonic time, handed in by the caller.
using TimePoint = std::chrono::steady_clock::time_point;
using Duration = std::chrono::steady_clock::duration;

/// A run of any campaign.
using RunKey = std::pair<wire::CampaignId, RunIndex>;

/// Runs whose simulation crashed, together, outside this process.
struct CrashedBatch {
  wire::CampaignId campaign;
  std::vector<RunIndex> runs;  ///< Not empty.
  std::string reason;          ///< For people.
};

/// Runs that are being computed together.
struct RunningBatch {
  std::uint64_t number = 0;  ///< No other batch of the execution has it.
  wire::CampaignId campaign;
  std::vector<RunRange> ranges;  ///< Not empty.
  std::uint32_t num_steps_done = 0;
  /// Until its results are there, if it goes on as it has; nothing before its first step is done.
  std::optional<Duration> time_left;
};

/// What the conversation with a coordinator needs of whatever computes runs. Neither knows how the
/// other works. A run is in one of four places: it waits, is in a batch, is finished, or has
/// crashed.
class Execution {
 public:
  virtual ~Execution() = default;

  /// True from define() on; false again after forget(), or once the campaign has had no runs here
  /// and room was needed for others.
  [[nodiscard]] virtual bool is_defined(wire::CampaignId campaign) const = 0;
  /// The campaign of a definition that was received; it has no table columns.
  /// @throws DefinitionError if it is none.
  [[nodiscard]] virtual std::shared_ptr<const Campaign> read(Definition definition) const {
    const Model* const model =
        definition.model.empty() ? &built_in_model() : find_model(definition.model);
    if (model == nullptr) {
      throw DefinitionError("definition: is of the model " + definition.model +
                            ", which this worker does not have");
    }
    return model->campaign_of(std::move(definition), TableColumns::left_out, "definition");
  }
  /// What the runs of a campaign compute. @pre It is not defined.
  virtual void define(wire::CampaignId campaign, std::shared_ptr<const Campaign> definition) = 0;

  /// Queues some runs of a lease; those of a campaign that is not defined wait until it is.
  /// @pre The execution has none of them.
  virtual void submit(const proto::RunLease& lease, std::span<const RunRange> runs) = 0;

  /// Drops those of these runs that wait, and returns them in ascending order.
  [[nodiscard]] virtual std::vector<RunIndex> drop_waiting(wire::CampaignId campaign,
                                                           std::span<const RunRange> ranges) = 0;
  /// Drops the runs of a batch; false if there is no such batch (any more).
  [[nodiscard]] virtual bool drop_batch(std::uint64_t number) = 0;
  /// Drops all runs of a campaign, finished and crashed ones included, and its definition.
  virtual void forget(wire::CampaignId campaign) = 0;
  /// Drops all runs that are not finished.
  virtual void abandon() = 0;

  /// Finished runs, each handed out once, in the order in which they finished. Their attempt is not
  /// known here: it may change while a run is being computed.
  [[nodiscard]] virtual std::vector<wire::LeasedResult> take_finished() = 0;
  /// Crashed ones, each handed out once; none if all that simulates is within this process.
  [[nodiscard]] virtual std::vector<CrashedBatch> take_crashed() { return {}; }
  [[nodiscard]] virtual std::vector<RunningBatch> computing() const = 0;
  /// The longest that a latest batch took, of the campaigns that are defined; nothing if none has
  /// finished one.
  [[nodiscard]] virtual std::optional<Duration> usual_batch_time() const = 0;
  [[nodiscard]] virtual std::uint64_t num_steps_done() const = 0;
  /// Why no run can be computed any more, if so.
  [[nodiscard]] virtual std::optional<std::string> failure() const = 0;
};

}  // namespace proofmass::worker
