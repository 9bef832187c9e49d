#include "coordinator/archive/series_output.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iterator>
#include <string_view>
#include <utility>

#include "core/error.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator {
namespace {

/// @throws InvalidArgument for a name of `chosen` that is not one of `known`.
void require_known(std::string_view field, std::span<const std::string> chosen,
                   const std::vector<std::string>& known) {
  for (const std::string& name : chosen) {
    if (std::ranges::find(known, name) != known.end()) continue;
    throw InvalidArgument(
        fmt::format("{} = {} (must be one of {})", field, name, fmt::join(known, " ")));
  }
}

template <typename Named>
std::vector<std::string> names_of_all(const std::vector<Named>& all) {
  std::vector<std::string> names;
  for (const Named& one : all) names.push_back(one.name);
  return names;
}

bool is_chosen(std::span<const std::string> chosen, const std::string& name) {
  return chosen.empty() || std::ranges::find(chosen, name) != chosen.end();
}

/// A unit as plotting programs write it: `m/s2` for `m/s²`.
std::string plain_unit(std::string_view unit) {
  constexpr std::string_view square = "²";
  std::string plain;
  while (!unit.empty()) {
    const bool is_square = unit.starts_with(square);
    plain += is_square ? '2' : unit.front();
    unit.remove_prefix(is_square ? square.size() : 1);
  }
  return plain;
}

std::string series_heading(const SignalSelection& selection) {
  std::string line = "time {s}";
  for (const SignalSelection::Group& group : selection.groups()) {
    for (const RecordedSignal& signal : group.info->signals) {
      line += fmt::format(",{}.{} {{{}}}", group.info->name, signal.name, plain_unit(signal.unit));
    }
  }
  return line + "\r\n";
}

class CsvSeries final : public SeriesOutput {
 public:
  CsvSeries(std::filesystem::path directory, RunIndex run, const SignalSelection& selection)
      : directory_(std::move(directory)), run_(run), selection_(selection) {}

  void add(const RecordedSample& sample) override {
    if (!selection_.has_session(sample.session)) return;
    if (files_.empty() || session_ != sample.session) begin_session(sample.session);
    const auto end = std::back_inserter(text_);
    fmt::format_to(end, "{}", sample.time_s);
    for (const SignalSelection::Group& group : selection_.groups()) {
      for (const double value :
           sample.values.subspan(group.first_value, group.info->signals.size())) {
        fmt::format_to(end, ",{}", value);
      }
    }
    fmt::format_to(end, "\r\n");
    constexpr std::size_t text_size_max = 1 << 18;
    if (text_.size() >= text_size_max) flush();
  }

  void finish() override {
    // A full disk is found before any file appears.
    flush();
    for (const auto& file : files_) file->publish(wire::IfThere::replace);
  }

 private:
  void flush() {
    if (!files_.empty()) files_.back()->write({text_.data(), text_.size()});
    text_.clear();
  }

  void begin_session(std::size_t index) {
    flush();
    session_ = index;
    const RecordedSession& session = selection_.recording().sessions[index];
    files_.push_back(
        std::make_unique<wire::DraftFile>("output", csv_series_file(directory_, run_, session)));
    text_.append(series_heading(selection_));
  }

  std::filesystem::path directory_;
  RunIndex run_;
  const SignalSelection& selection_;
  std::size_t session_ = 0;                              ///< The session of the last file.
  std::vector<std::unique_ptr<wire::DraftFile>> files_;  ///< One a session.
  fmt::memory_buffer text_;                              ///< What the last file does not have yet.
};

}  // namespace

SignalSelection::SignalSelection(const Recording& recording, std::span<const std::string> sessions,
                                 std::span<const std::string> groups)
    : recording_(&recording) {
  require_known("session", sessions, names_of_all(recording.sessions));
  require_known("group", groups, names_of_all(recording.groups));
  for (const RecordedSession& session : recording.sessions) {
    has_session_.push_back(is_chosen(sessions, session.name));
  }
  std::size_t first_value = 0;
  for (const SignalGroup& group : recording.groups) {
    if (is_chosen(groups, group.name)) groups_.push_back({&group, first_value});
    first_value += group.signals.size();
  }
}

std::filesystem::path csv_series_file(const std::filesystem::path& directory, RunIndex run,
                                      const RecordedSession& session) {
  return directory / fmt::format("run{}_{}.csv", run.value, session.name);
}

std::unique_ptr<SeriesOutput> csv_series(const std::filesystem::path& directory, RunIndex run,
                                         const SignalSelection& selection) {
  return std::make_unique<CsvSeries>(directory, run, selection);
}

}  // namespace proofmass::coordinator
