#include "coordinator/net/factory_reports.hpp"

#include <fmt/format.h>

#include <chrono>

#include "core/error.hpp"

namespace proofmass::coordinator {

void FactoryReports::take(const proto::FactoryReport& report, const std::string& owner,
                          TimePoint now) {
  std::erase_if(known_, [&](const auto& entry) { return is_silent(entry.second, now); });
  const std::pair key(report.name(), owner);
  if (!known_.contains(key) && known_.size() >= wire::factories_max) {
    throw Error(
        fmt::format("factories = {} (must be at most {})", known_.size() + 1, wire::factories_max));
  }
  known_.insert_or_assign(key, Known{.report = report, .heard_at = now});
}

std::vector<proto::FactoryStatus> FactoryReports::current(TimePoint now) const {
  std::vector<proto::FactoryStatus> factories;
  for (const auto& [key, known] : known_) {
    if (is_silent(known, now)) continue;
    proto::FactoryStatus& factory = factories.emplace_back();
    *factory.mutable_report() = known.report;
    factory.set_owner(key.second);
    factory.set_silent_s(std::chrono::duration<double>(now - known.heard_at).count());
  }
  return factories;
}

bool FactoryReports::is_silent(const Known& known, TimePoint now) {
  return now - known.heard_at > 3 * std::chrono::seconds(known.report.interval_s());
}

}  // namespace proofmass::coordinator
