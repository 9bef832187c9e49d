#include "tests/support/faults/planned_faults.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <set>
#include <utility>

#include "core/error.hpp"
#include "core/random/stream.hpp"

namespace proofmass::wire {
namespace {

// Each question about a message has its own random number; the last two are one a copy.
constexpr std::uint32_t stream_cut = 0;
constexpr std::uint32_t stream_drop = 1;
constexpr std::uint32_t stream_duplicate = 2;
constexpr std::uint32_t stream_reorder = 3;
constexpr std::uint32_t stream_delay = 4;
constexpr std::uint32_t stream_delay_duration = 6;

constexpr double duration_s_max = 3600.0;
/// A message that waits to be overtaken goes alone if no other comes.
constexpr std::chrono::milliseconds held_duration_max(500);

LinkTime::duration seconds(double duration_s) {
  return std::chrono::duration_cast<LinkTime::duration>(std::chrono::duration<double>(duration_s));
}

/// A value of a plan's text.
struct Item {
  std::string_view key;
  std::string_view value;

  [[noreturn]] void refuse(std::string_view rule) const {
    throw InvalidArgument(fmt::format("faults.{} = {} ({})", key, value, rule));
  }

  template <typename Number>
  [[nodiscard]] Number number(std::string_view text, Number min, Number max,
                              std::string_view rule) const {
    Number parsed{};
    const char* const end = text.data() + text.size();
    const auto [stop, error] = std::from_chars(text.data(), end, parsed);
    // Written so that a value that is not a number is refused.
    if (error == std::errc() && stop == end && parsed >= min && parsed <= max) return parsed;
    refuse(rule);
  }

  /// The parts before and after the colon.
  [[nodiscard]] std::pair<std::string_view, std::string_view> halves(std::string_view rule) const {
    const std::size_t colon = value.find(':');
    if (colon == std::string_view::npos) refuse(rule);
    return {value.substr(0, colon), value.substr(colon + 1)};
  }
};

double probability(const Item& item) {
  return item.number(item.value, 0.0, 1.0, "must be in [0, 1]");
}

FaultPlan::Timed timed(const Item& item) {
  constexpr std::string_view rule = "must be PROBABILITY:SECONDS, in [0, 1] and in [0.001, 3600]";
  const auto [probability_text, duration_text] = item.halves(rule);
  return {.probability = item.number(probability_text, 0.0, 1.0, rule),
          .duration_s = item.number(duration_text, 0.001, duration_s_max, rule)};
}

FaultPlan::Kill kill(const Item& item) {
  constexpr std::string_view rule = "must be POINT:PASSAGE, the passage from 1";
  const auto [name, passage] = item.halves(rule);
  const auto point = kill_point_from(name);
  if (!point) item.refuse("the point is unknown");
  return {.point = *point, .passage = item.number(passage, std::uint64_t{1}, UINT64_MAX, rule)};
}

void set(FaultPlan& plan, const Item& item) {
  if (item.key == "seed") {
    plan.seed = item.number(item.value, std::uint64_t{0}, UINT64_MAX, "must be in [0, 2^64)");
  } else if (item.key == "drop") {
    plan.drop = probability(item);
  } else if (item.key == "duplicate") {
    plan.duplicate = probability(item);
  } else if (item.key == "reorder") {
    plan.reorder = probability(item);
  } else if (item.key == "delay") {
    plan.delay = timed(item);
  } else if (item.key == "cut") {
    plan.cut = timed(item);
  } else if (item.key == "kill") {
    plan.kill = kill(item);
  } else {
    item.refuse("must be seed, drop, duplicate, reorder, delay, cut or kill");
  }
}

}  // namespace

FaultPlan FaultPlan::parse(std::string_view text) {
  FaultPlan plan;
  std::set<std::string_view> keys;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string_view entry = text.substr(begin, end - begin);
    const std::size_t equals = entry.find('=');
    if (equals == std::string_view::npos) {
      throw InvalidArgument(fmt::format("faults = {} (must be KEY=VALUE,...)", text));
    }
    const Item item{.key = entry.substr(0, equals), .value = entry.substr(equals + 1)};
    if (!keys.insert(item.key).second) item.refuse("given twice");
    set(plan, item);
    begin = end + 1;
  }
  return plan;
}

FaultyLink::FaultyLink(const FaultPlan& plan, Direction direction)
    : plan_(plan), direction_(direction) {}

void FaultyLink::pass(std::string routing, std::string bytes, LinkTime now) {
  ++num_passed_;
  if (is_lost(routing, now)) return;
  const std::uint32_t num_copies = happens(plan_.duplicate, stream_duplicate) ? 2 : 1;
  if (happens(plan_.reorder, stream_reorder)) {
    for (std::uint32_t copy = 0; copy < num_copies; ++copy) {
      held_[routing].push_back(under_way_.emplace(now + held_duration_max, Parcel{routing, bytes}));
    }
    return;
  }
  for (std::uint32_t copy = 0; copy < num_copies; ++copy) {
    under_way_.emplace(arrival(copy, now), Parcel{routing, bytes});
  }
  let_held_follow(routing, arrival(0, now));
}

std::vector<Parcel> FaultyLink::due(LinkTime now) {
  std::vector<Parcel> parcels;
  while (!under_way_.empty() && under_way_.begin()->first <= now) {
    const auto first = under_way_.begin();
    if (const auto held = held_.find(first->second.routing); held != held_.end()) {
      std::erase(held->second, first);
      if (held->second.empty()) held_.erase(held);
    }
    parcels.push_back(std::move(first->second));
    under_way_.erase(first);
  }
  return parcels;
}

std::optional<LinkTime> FaultyLink::next_due() const {
  if (under_way_.empty()) return std::nullopt;
  return under_way_.begin()->first;
}

double FaultyLink::draw(std::uint32_t stream) const {
  return uniform(philox(
      {static_cast<std::uint32_t>(num_passed_), static_cast<std::uint32_t>(num_passed_ >> 32),
       stream, static_cast<std::uint32_t>(direction_)},
      plan_.seed));
}

bool FaultyLink::happens(double probability, std::uint32_t stream) const {
  return probability > 0.0 && draw(stream) < probability;
}

bool FaultyLink::is_lost(const std::string& routing, LinkTime now) {
  if (const auto cut = cut_until_.find(routing); cut != cut_until_.end()) {
    if (now < cut->second) return true;
    cut_until_.erase(cut);
  }
  if (happens(plan_.cut.probability, stream_cut)) {
    cut_until_[routing] = now + seconds(plan_.cut.duration_s);
    return true;
  }
  return happens(plan_.drop, stream_drop);
}

LinkTime FaultyLink::arrival(std::uint32_t copy, LinkTime now) const {
  if (!happens(plan_.delay.probability, stream_delay + copy)) return now;
  return now + seconds(draw(stream_delay_duration + copy) * plan_.delay.duration_s);
}

void FaultyLink::let_held_follow(const std::string& routing, LinkTime arrival) {
  const auto held = held_.find(routing);
  if (held == held_.end()) return;
  for (const UnderWay::iterator parcel : held->second) {
    auto entry = under_way_.extract(parcel);
    entry.key() = arrival;
    under_way_.insert(std::move(entry));  // Behind all others of that time.
  }
  held_.erase(held);
}

namespace {

// Of the process, as is the point at which it dies.
std::optional<FaultPlan>& plan_of_process() {
  static std::optional<FaultPlan> plan;
  return plan;
}

}  // namespace

void plan_faults(const std::optional<FaultPlan>& plan) {
  plan_of_process() = plan;
  if (plan && plan->kill) arm_kill_point(plan->kill->point, plan->kill->passage);
}

std::unique_ptr<LinkFaults> link_faults(LinkFaults::Direction direction) {
  const std::optional<FaultPlan>& plan = plan_of_process();
  return plan ? std::make_unique<FaultyLink>(*plan, direction) : nullptr;
}

void add_fault_option(CLI::App& app) {
  app.add_option_function<std::string>(
         "--faults", [](const std::string& text) { plan_faults(FaultPlan::parse(text)); })
      ->group("");
}

}  // namespace proofmass::wire
