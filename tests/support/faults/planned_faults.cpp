#include "tests/support/faults/planned_faults.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
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

/// A message that waits to be overtaken goes alone if no other comes.
constexpr std::chrono::milliseconds held_duration_max(500);

LinkTime::duration seconds(double duration_s) {
  return std::chrono::duration_cast<LinkTime::duration>(std::chrono::duration<double>(duration_s));
}

/// `key=first` or `key=first:second` of a plan's text.
struct Item {
  explicit Item(std::string_view text)
      : key(text.substr(0, text.find('='))),
        first(text.substr(std::min(key.size() + 1, text.size()))) {
    const std::size_t colon = std::min(first.find(':'), first.size());
    second = first.substr(std::min(colon + 1, first.size()));
    first = first.substr(0, colon);
  }

  [[noreturn]] void refuse() const {
    throw InvalidArgument(
        fmt::format("faults.{} = {}:{} (see tests/support/faults)", key, first, second));
  }

  template <typename Number>
  [[nodiscard]] Number number(std::string_view text, Number min, Number max) const {
    Number parsed{};
    const char* const end = text.data() + text.size();
    const auto [stop, error] = std::from_chars(text.data(), end, parsed);
    // Written so that a value that is not a number is refused.
    if (error == std::errc() && stop == end && parsed >= min && parsed <= max) return parsed;
    refuse();
  }

  std::string_view key;
  std::string_view first;
  std::string_view second;
};

void set(FaultPlan& plan, const Item& item) {
  const std::map<std::string_view, double*> probabilities{{"drop", &plan.drop},
                                                          {"duplicate", &plan.duplicate},
                                                          {"reorder", &plan.reorder},
                                                          {"delay", &plan.delay.probability},
                                                          {"cut", &plan.cut.probability}};
  if (item.key == "seed") {
    plan.seed = item.number(item.first, std::uint64_t{0}, UINT64_MAX);
  } else if (item.key == "kill") {
    const auto point = kill_point_from(item.first);
    if (!point) item.refuse();
    plan.kill = {.point = *point,
                 .passage = item.number(item.second, std::uint64_t{1}, UINT64_MAX)};
  } else if (const auto found = probabilities.find(item.key); found != probabilities.end()) {
    *found->second = item.number(item.first, 0.0, 1.0);
    if (item.key == "delay" || item.key == "cut") {
      (item.key == "cut" ? plan.cut : plan.delay).duration_s =
          item.number(item.second, 0.001, 3600.0);
    }
  } else {
    item.refuse();
  }
}

}  // namespace

FaultPlan FaultPlan::parse(std::string_view text) {
  FaultPlan plan;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    set(plan, Item(text.substr(begin, end - begin)));
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
