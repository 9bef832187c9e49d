#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/link/kill_point.hpp"

namespace proofmass::wire {

using LinkTime = std::chrono::steady_clock::time_point;

/// What shall go wrong, for tests of this program by itself. Probabilities are in [0, 1] and apply
/// to each message on its own.
struct FaultPlan {
  struct Timed {
    double probability = 0.0;
    double duration_s = 0.0;  ///< In (0, 3600].
  };
  struct Kill {
    KillPoint point = KillPoint::after_commit;
    std::uint64_t passage = 1;  ///< The process dies at the n-th, from 1.
  };

  std::uint64_t seed = 1;
  double drop = 0.0;       ///< Lost.
  double duplicate = 0.0;  ///< Arrives twice; each copy is delayed by itself.
  double reorder = 0.0;    ///< Overtaken by the next message of the same peer, if one comes soon.
  Timed delay;             ///< Late by a time uniform on (0, duration).
  Timed cut;               ///< Lost, and all others of that peer for the duration.
  std::optional<Kill> kill;

  /// Reads `seed=7,drop=0.1,delay=0.2:2.0,duplicate=0.05,reorder=0.1,cut=0.01:3.0,
  /// kill=after_commit:3` in any order; what is left out does not happen.
  /// @throws InvalidArgument reading `faults.drop = 2 (must be in [0, 1])`.
  [[nodiscard]] static FaultPlan parse(std::string_view text);
};

/// A message on its way.
struct Parcel {
  std::string routing;  ///< Whom it goes to or comes from.
  std::string bytes;
};

/// Stands between a service and its socket, one for each direction, and does to the messages what
/// the plan says. Which message meets which fault is a function of the plan's seed, the direction
/// and the message's number alone. It has no clock of its own.
class FaultyLink {
 public:
  enum class Direction : std::uint8_t { sending = 1, receiving = 2 };

  FaultyLink(const FaultPlan& plan, Direction direction);

  /// Hands a message over; it comes out of due() some time, once, twice or not at all.
  ///
  /// @param now  Never earlier than in the call before.
  void pass(std::string routing, std::string bytes, LinkTime now);

  /// Takes all messages whose time has come, in order of that time.
  [[nodiscard]] std::vector<Parcel> due(LinkTime now);

  /// When due() has something next; nothing if no message is under way.
  [[nodiscard]] std::optional<LinkTime> next_due() const;

 private:
  using UnderWay = std::multimap<LinkTime, Parcel>;

  [[nodiscard]] bool happens(double probability, std::uint32_t stream) const;
  [[nodiscard]] double draw(std::uint32_t stream) const;
  [[nodiscard]] bool is_lost(const std::string& routing, LinkTime now);
  [[nodiscard]] LinkTime arrival(std::uint32_t copy, LinkTime now) const;
  void let_held_follow(const std::string& routing, LinkTime arrival);

  FaultPlan plan_;
  Direction direction_;
  std::uint64_t num_passed_ = 0;
  UnderWay under_way_;
  std::map<std::string, std::vector<UnderWay::iterator>> held_;  ///< Wait for the peer's next one.
  std::map<std::string, LinkTime> cut_until_;
};

}  // namespace proofmass::wire
