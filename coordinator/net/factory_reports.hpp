#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/dispatch/state.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {

/// What factories last said of themselves; in memory only. A factory that is silent for more than
/// three of its intervals is forgotten.
class FactoryReports {
 public:
  /// Replaces the report of the same name and owner.
  /// @param owner  Name of the key that reports; empty without keys.
  /// @throws Error if the limit of known factories is reached.
  void take(const proto::FactoryReport& report, const std::string& owner, TimePoint now);

  /// By name, at most wire::factories_max.
  [[nodiscard]] std::vector<proto::FactoryStatus> current(TimePoint now) const;

 private:
  struct Known {
    proto::FactoryReport report;
    TimePoint heard_at;
  };

  [[nodiscard]] static bool is_silent(const Known& known, TimePoint now);

  std::map<std::pair<std::string, std::string>, Known> known_;  ///< By name and owner.
};

}  // namespace proofmass::coordinator
