#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/link/faults.hpp"

namespace proofmass::wire {

inline constexpr int num_kill_points = 11;

/// That of this name, as `after_commit`.
[[nodiscard]] std::optional<KillPoint> kill_point_from(std::string_view name);

/// Makes the process die when it passes a place for the n-th time.
/// To be called before the process has other threads.
///
/// @param passage  n, from 1.
void arm_kill_point(KillPoint point, std::uint64_t passage);

/// What shall go wrong. Probabilities are in [0, 1] and apply to each message on its own.
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
  /// @throws InvalidArgument
  [[nodiscard]] static FaultPlan parse(std::string_view text);
};

/// That of the process, which link_faults() follows.
void plan_faults(const std::optional<FaultPlan>& plan);

/// Does to the messages what the plan says. Which message meets which fault is a function of the
/// plan's seed, the direction and the message's number alone. It has no clock of its own.
class FaultyLink final : public LinkFaults {
 public:
  FaultyLink(const FaultPlan& plan, Direction direction);

  void pass(std::string routing, std::string bytes, LinkTime now) override;
  [[nodiscard]] std::vector<Parcel> due(LinkTime now) override;

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
