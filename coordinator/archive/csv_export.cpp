#include <fmt/format.h>

#include <cstddef>
#include <iterator>
#include <optional>

#include "coordinator/archive/export.hpp"
#include "coordinator/archive/result_columns.hpp"
#include "core/campaign/model.hpp"

namespace proofmass::coordinator {
namespace {

// No cell has a comma, a quotation mark or a line break, so that none needs quotation marks.
constexpr std::string_view line_end = "\r\n";

std::string heading(const DrawnColumns& draws) {
  std::string line = "run_index,status,num_draws,num_rounds";
  for (const ValueColumn& column : value_columns()) line.append(",").append(column.name);
  line += ",loss_cause,loss_session";
  for (std::size_t i = 0; i < draws.count(); ++i) line.append(",").append(draw_column_name(i));
  return line.append(line_end);
}

void append_draws(const DrawnColumns& draws, RunIndex run, fmt::memory_buffer& line) {
  const std::vector<double> values = draws.values_of(run);
  for (std::size_t i = 0; i < draws.count(); ++i) {
    line.push_back(',');
    if (!values.empty()) fmt::format_to(std::back_inserter(line), "{}", values[i]);
  }
}

void append_line(const RunResult& result, const DrawnColumns& draws, fmt::memory_buffer& line) {
  const auto end = std::back_inserter(line);
  fmt::format_to(end, "{},{},{},{}", result.run.value, name_of(result.status), result.num_draws,
                 result.num_rounds);
  for (const ValueColumn& column : value_columns()) {
    const std::optional<double> value = column.value_in(result);
    line.push_back(',');
    if (value) fmt::format_to(end, "{}", *value);
  }
  if (result.status == RunStatus::lost) {
    fmt::format_to(end, ",{},{}", name_at(model().results().loss_causes, result.loss.cause),
                   name_at(model().results().loss_sessions, result.loss.session));
  } else {
    fmt::format_to(end, ",,");
  }
  append_draws(draws, result.run, line);
  line.append(line_end);
}

}  // namespace

WalkedResults walk_results(const Store& store, const IsStopped& is_stopped,
                           const std::function<void(const RunResult&)>& visit) {
  constexpr std::uint64_t visits_between_questions = 1024;
  std::uint64_t num_visits = 0;
  return walk_checked(store, [&](const RunResult& result) {
    if (num_visits++ % visits_between_questions == 0 && is_stopped()) throw Interrupted();
    visit(result);
  });
}

void export_csv(const Store& store, TextOutput& output, const IsStopped& is_stopped,
                DrawColumns draws) {
  store.read_one_state([&] {
    check_definition_digest(store);
    const DrawnColumns drawn(store, draws);
    output.write(heading(drawn));
    fmt::memory_buffer line;
    (void)walk_results(store, is_stopped, [&](const RunResult& result) {
      line.clear();
      append_line(result, drawn, line);
      output.write({line.data(), line.size()});
    });
  });
  output.finish();
}

}  // namespace proofmass::coordinator
