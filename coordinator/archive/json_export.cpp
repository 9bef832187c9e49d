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
                   is_first_ ? "\n" : ",\n", result.run.value, name_of(result.status),
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
    if (result.status == RunStatus::lost) {
      fmt::format_to(end, R"(,"loss_cause":"{}","loss_session":"{}"}})", name_of(result.loss.cause),
                     name_of(result.loss.session));
    } else {
      fmt::format_to(end, R"(,"loss_cause":null,"loss_session":null}})");
    }
    output_.write({line_.data(), line_.size()});
    is_first_ = false;
  }

 private:
  TextOutput& output_;
  fmt::memory_buffer line_;
  bool is_first_ = true;
};

}  // namespace

void export_json(const Store& store, TextOutput& output, const IsStopped& is_stopped) {
  check_definition_digest(store);
  output.write(fmt::format("{{\"campaign\":{},\n\"columns\":{},\n\"runs\":[",
                           text_of(campaign_json(store)), text_of(columns_json())));
  RunLines lines(output);
  const WalkedResults walked =
      walk_results(store, is_stopped, [&](const RunResult& result) { lines.add(result); });
  output.write(fmt::format("\n],\n\"num_finished\":{},\n\"digest\":\"{}\"}}\n", walked.num_results,
                           walked.digest));
  output.finish();
}

}  // namespace proofmass::coordinator
