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
#include "core/campaign/model.hpp"

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

Json columns_json(const DrawnColumns& draws) {
  Json columns = Json::array();
  for (const ValueColumn& column : value_columns()) {
    columns.push_back({{"name", column.name}, {"unit", column.unit}});
  }
  for (std::size_t i = 0; i < draws.count(); ++i) {
    columns.push_back({{"name", draw_column_name(i)}, {"unit", model().drawn()[i].unit}});
  }
  return columns;
}

class RunLines {
 public:
  RunLines(TextOutput& output, const DrawnColumns& draws) : output_(output), draws_(draws) {}

  void add(const RunResult& result) {
    line_.clear();
    const auto end = std::back_inserter(line_);
    fmt::format_to(end, R"({}{{"run_index":{},"status":"{}","num_draws":{},"num_rounds":{})",
                   is_first_ ? "\n" : ",\n", result.run.value, name_of(result.status),
                   result.num_draws, result.num_rounds);
    for (const ValueColumn& column : value_columns()) {
      add_number(column.name, column.value_in(result));
    }
    if (result.status == RunStatus::lost) {
      fmt::format_to(end, R"(,"loss_cause":"{}","loss_session":"{}")",
                     name_at(model().results().loss_causes, result.loss.cause),
                     name_at(model().results().loss_sessions, result.loss.session));
    } else {
      fmt::format_to(end, R"(,"loss_cause":null,"loss_session":null)");
    }
    add_draws(result.run);
    line_.push_back('}');
    output_.write({line_.data(), line_.size()});
    is_first_ = false;
  }

 private:
  void add_number(const std::string& name, std::optional<double> value) {
    const auto end = std::back_inserter(line_);
    fmt::format_to(end, R"(,"{}":)", name);
    if (value) {
      fmt::format_to(end, "{}", *value);
    } else {
      fmt::format_to(end, "null");
    }
  }

  void add_draws(RunIndex run) {
    const std::vector<double> values = draws_.values_of(run);
    for (std::size_t i = 0; i < draws_.count(); ++i) {
      add_number(draw_column_name(i), values.empty() ? std::nullopt : std::optional(values[i]));
    }
  }

  TextOutput& output_;
  const DrawnColumns& draws_;
  fmt::memory_buffer line_;
  bool is_first_ = true;
};

}  // namespace

void export_json(const Store& store, TextOutput& output, const IsStopped& is_stopped,
                 DrawColumns draws) {
  store.read_one_state([&] {
    check_definition_digest(store);
    const DrawnColumns drawn(store, draws);
    output.write(fmt::format("{{\"campaign\":{},\n\"columns\":{},\n\"runs\":[",
                             text_of(campaign_json(store)), text_of(columns_json(drawn))));
    RunLines lines(output, drawn);
    const WalkedResults walked =
        walk_results(store, is_stopped, [&](const RunResult& result) { lines.add(result); });
    output.write(fmt::format("\n],\n\"num_finished\":{},\n\"digest\":\"{}\"}}\n",
                             walked.num_results, walked.digest));
  });
  output.finish();
}

}  // namespace proofmass::coordinator
