#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>

#include "coordinator/net/service_snapshot.hpp"

namespace proofmass::coordinator {

/// Where the thread of a service leaves snapshots for the thread of a page. The service makes one a
/// second at most, and none if nobody has asked for 30 s, so that a page at which nobody looks
/// costs nothing. Any thread may call the functions. Times are of the steady clock.
class SnapshotBoard {
 public:
  static constexpr std::chrono::milliseconds interval{1000};
  static constexpr std::chrono::milliseconds wanted_for{30'000};
  static constexpr std::chrono::milliseconds age_max{1500};

  explicit SnapshotBoard(TimePoint now) : turned_at_(now) {}

  /// Asks for snapshots of this depth.
  /// @return The newest one if it is that deep and not older than `age_max`; else null: a new one
  ///         comes with the next turn of the service.
  [[nodiscard]] std::shared_ptr<const ServiceSnapshot> want(SnapshotDepth depth, TimePoint now);

  /// However old it is; null before the first.
  [[nodiscard]] std::shared_ptr<const ServiceSnapshot> newest() const;

  /// To be called in each turn of the service's loop.
  /// @param take  Makes a snapshot; called if one is wanted.
  void on_turn(TimePoint now, const std::function<ServiceSnapshot(SnapshotDepth)>& take);

  /// Since the last turn, or since the board was made.
  [[nodiscard]] Duration since_turn(TimePoint now) const;

 private:
  [[nodiscard]] bool is_wanted(const std::optional<TimePoint>& asked_at, TimePoint now) const {
    return asked_at && now - *asked_at < wanted_for;
  }

  mutable std::mutex mutex_;
  TimePoint turned_at_;
  std::optional<TimePoint> asked_at_;              ///< For any snapshot.
  std::optional<TimePoint> asked_for_workers_at_;  ///< For one with workers.
  bool is_urgent_ = false;  ///< Somebody waits: the newest is too old or lacks the workers.
  SnapshotDepth newest_depth_ = SnapshotDepth::without_workers;
  /// Shared with answers that are being made of it.
  std::shared_ptr<const ServiceSnapshot> newest_;
};

}  // namespace proofmass::coordinator
