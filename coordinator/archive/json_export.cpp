#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>

#include "coordinator/archive/export.hpp"
#include "coordinator/archive/result_columns.hpp"
#include "coordinator/report/digest.hpp"

namespace proofmass::coordinator {
namespace {

using Json = nlohmann::ordered_json;

std::string text_of(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

// The seed is text: many readers take all numbers for doubles, and it has 64 bits.
Json campaign_json(const Store& store) {
  return {{"name", store.name()},         {"seed", std::to_string(store.seed())},
          {"num_runs", store.num_runs()}, {"model_version", store.model_version()},
          {"build", store.build()},       {"definition", store.definition()}};
}

Json columns_json() {
  Json columns = Json::array();
  for (const ValueColumn& column : value_columns()) {
    columns.push_back({{"name", column.name}, {"unit", column.unit}});
  }
  return columns;
}

class RunLines {
 public:
  explicit RunLines(TextOutput& output) : output_(output) {}

  void add(const RunResult& result) {
    line_.clear();
    const auto end = std::back_inserter(line_);
    fmt::format_to(end, R"({}{{"run_index":{},"status":"{}","num_draws":{},"num_rounds":{})",
                   num_runs_ == 0 ? "\n" : ",\n", result.run.value, name_of(result.status),
                   result.num_draws, result.num_rounds);
    for (const ValueColumn& column : value_columns()) {
      const std::optional<double> value = column.value_in(result);
      fmt::format_to(end, R"(,"{}":)", column.name);
      if (value) {
        fmt::format_to(end, "{}", *value);
      } else {
        fmt::format_to(end, "null");
      }
    }
    line_.push_back('}');
    output_.write({line_.data(), line_.size()});
    ++num_runs_;
  }

  [[nodiscard]] std::uint64_t num_runs() const { return num_runs_; }

 private:
  TextOutput& output_;
  fmt::memory_buffer line_;
  std::uint64_t num_runs_ = 0;
};

}  // namespace

void export_json(const Store& store, TextOutput& output, const IsStopped& is_stopped) {
  output.write(fmt::format("{{\"campaign\":{},\n\"columns\":{},\n\"runs\":[",
                           text_of(campaign_json(store)), text_of(columns_json())));
  RunLines lines(output);
  Digest digest;
  walk_results(store, is_stopped, [&](const RunResult& result) {
    lines.add(result);
    digest.add(result);
  });
  output.write(fmt::format("\n],\n\"num_finished\":{},\n\"digest\":\"{}\"}}\n", lines.num_runs(),
                           digest.finish()));
  output.finish();
}

}  // namespace proofmass::coordinator
