#include "coordinator/archive/export.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>

#include "coordinator/archive/result_columns.hpp"
#include "core/model.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t buffer_size = 1 << 18;  // Of a TextOutput.

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

TextOutput::TextOutput(const std::filesystem::path& path) {
  file_.emplace("output", path);
  descriptor_ = file_->open();
}

TextOutput::~TextOutput() {
  if (file_ && descriptor_ >= 0) ::close(descriptor_);
}

void TextOutput::write(std::string_view text) {
  buffer_ += text;
  if (buffer_.size() >= buffer_size) flush();
}

void TextOutput::finish() {
  write_rest();
  if (file_) file_->publish(wire::IfThere::replace);
}

void TextOutput::write_rest() {
  flush();
  if (!file_ || descriptor_ < 0) return;
  const int descriptor = std::exchange(descriptor_, -1);
  if (::close(descriptor) != 0) file_->fail(errno);
}

void TextOutput::flush() {
  std::string_view rest = buffer_;
  while (!rest.empty()) {
    const ssize_t size = ::write(descriptor_, rest.data(), rest.size());
    if (size < 0 && errno != EINTR) fail();
    if (size > 0) rest.remove_prefix(static_cast<std::size_t>(size));
  }
  buffer_.clear();
}

void TextOutput::fail() const {
  if (file_) file_->fail(errno);
  throw Error(fmt::format("output = - (cannot be written: {})", std::strerror(errno)));
}

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

void export_sqlite(const Store& store, const std::filesystem::path& file,
                   const IsStopped& is_stopped) {
  check_definition_digest(store);
  (void)walk_results(store, is_stopped, [](const RunResult&) {});
  wire::DraftFile draft("output", file);
  store.write_plain(draft.draft());
  draft.publish(wire::IfThere::replace);
}

}  // namespace proofmass::coordinator
