#include <signal.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstddef>

#include "core/error.hpp"
#include "tests/support/faults/planned_faults.hpp"

namespace proofmass::wire {
namespace {

constexpr std::array<std::string_view, num_kill_points> names{
    "after_receive", "before_commit", "after_commit",    "after_acknowledge",
    "after_lend",    "after_open",    "while_migrating", "after_lease",
    "before_result", "after_result",  "before_bye",
};

// A process dies as a whole, so this is of the process and not of an object in it.
constexpr int no_point = -1;
std::atomic<int> armed_point = no_point;
std::atomic<std::uint64_t> num_passages_left = 0;

}  // namespace

std::optional<KillPoint> kill_point_from(std::string_view name) {
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i] == name) return static_cast<KillPoint>(i);
  }
  return std::nullopt;
}

void arm_kill_point(KillPoint point, std::uint64_t passage) {
  PROOFMASS_EXPECT(passage >= 1);
  num_passages_left = passage;
  armed_point = static_cast<int>(point);
}

void kill_point(KillPoint point) {
  if (armed_point.load(std::memory_order_relaxed) != static_cast<int>(point)) return;
  if (num_passages_left.fetch_sub(1) == 1) ::kill(::getpid(), SIGKILL);
}

}  // namespace proofmass::wire
