#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "coordinator/archive/detail/hdf5_file.hpp"
#include "coordinator/archive/export.hpp"
#include "coordinator/archive/replay.hpp"
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

namespace {

using detail::GrowingDataset;
using detail::Hdf5File;
using detail::Hdf5Handle;

constexpr hsize_t samples_per_block = 1024;

/// A structure of doubles: the time, then the signals of a group.
Hdf5Handle sample_type(const Hdf5File& file, const SignalGroup& group, hid_t number) {
  constexpr std::size_t size = sizeof(double);
  Hdf5Handle type =
      file.handle(H5Tcreate(H5T_COMPOUND, (group.signals.size() + 1) * size), H5Tclose);
  file.check(H5Tinsert(type, "time", 0, number));
  for (std::size_t i = 0; i < group.signals.size(); ++i) {
    file.check(H5Tinsert(type, group.signals[i].name.c_str(), (i + 1) * size, number));
  }
  return type;
}

/// The dataset of one group of signals in one session.
class SignalTable {
 public:
  SignalTable(const Hdf5File& file, hid_t parent, const SignalSelection::Group& group)
      : group_(group),
        given_(sample_type(file, *group.info, H5T_NATIVE_DOUBLE)),
        dataset_(file, parent, group.info->name,
                 {.stored = sample_type(file, *group.info, H5T_IEEE_F64LE),
                  .given = given_,
                  .chunk_rows = samples_per_block}) {
    describe(file);
  }

  void add(const RecordedSample& sample) {
    const auto values = sample.values.subspan(group_.first_value, group_.info->signals.size());
    row_.assign(1, sample.time_s);
    row_.insert(row_.end(), values.begin(), values.end());
    dataset_.add(std::as_bytes(std::span(row_)));
  }

  void flush() { dataset_.flush(); }

 private:
  /// Attributes, of which each has a text for each field.
  void describe(const Hdf5File& file) {
    std::vector<std::string> units{"s"}, frames{""}, meanings{"from the start of the session"};
    for (const RecordedSignal& signal : group_.info->signals) {
      units.push_back(signal.unit);
      frames.push_back(signal.frame);
      meanings.push_back(signal.meaning);
    }
    file.set_text(dataset_.id(), "meaning", group_.info->meaning);
    file.set_texts(dataset_.id(), "units", units);
    file.set_texts(dataset_.id(), "frames", frames);
    file.set_texts(dataset_.id(), "meanings", meanings);
  }

  SignalSelection::Group group_;
  Hdf5Handle given_;
  GrowingDataset dataset_;
  std::vector<double> row_;
};

void describe_run(const Hdf5File& file, const SeriesOrigin& origin, const Recording& recording) {
  const hid_t root = file.root();
  const RunResult& result = origin.result;
  detail::describe_campaign(file, origin.store);
  file.set_text(root, "program_version", origin.program_version);
  file.set_count(root, "run_index", result.run.value);
  file.set_text(root, "status", std::string(name_of(result.status)));
  if (result.status == RunStatus::lost) {
    const ResultSchema& schema = origin.store.schema();
    file.set_text(root, "loss_cause", std::string(name_at(schema.loss_causes, result.loss.cause)));
    file.set_text(root, "loss_session",
                  std::string(name_at(schema.loss_sessions, result.loss.session)));
  }
  if (recording.frames.empty()) return;
  std::vector<std::string> names, meanings;
  for (const RecordedFrame& frame : recording.frames) {
    names.push_back(frame.name);
    meanings.push_back(frame.meaning);
  }
  file.set_texts(root, "frame_names", names);
  file.set_texts(root, "frame_meanings", meanings);
}

class Hdf5Series final : public SeriesOutput {
 public:
  Hdf5Series(const std::filesystem::path& file, const SeriesOrigin& origin,
             const SignalSelection& selection)
      : selection_(selection), draft_("output", file), file_(draft_) {
    describe_run(file_, origin, selection.recording());
  }

  void add(const RecordedSample& sample) override {
    if (!selection_.has_session(sample.session)) return;
    if (session_ != sample.session) begin_session(sample.session);
    for (SignalTable& table : tables_) table.add(sample);
  }

  void finish() override {
    end_session();
    file_.close();
    draft_.publish(wire::IfThere::replace);
  }

 private:
  void begin_session(std::size_t index) {
    end_session();
    session_ = index;
    const RecordedSession& session = selection_.recording().sessions[index];
    const Hdf5Handle group = file_.make_group(session.name);
    file_.set_text(group, "session", session.name);
    file_.set_number(group, "sample_rate_hz", 1.0 / session.sample_period_s);
    file_.set_number(group, "sample_period_s", session.sample_period_s);
    for (const SignalSelection::Group& signals : selection_.groups()) {
      tables_.emplace_back(file_, group, signals);
    }
  }

  void end_session() {
    for (SignalTable& table : tables_) table.flush();
    tables_.clear();
  }

  const SignalSelection& selection_;
  wire::DraftFile draft_;
  Hdf5File file_;
  std::optional<std::size_t> session_;
  std::vector<SignalTable> tables_;  ///< Of the session that is being written.
};

}  // namespace

std::unique_ptr<SeriesOutput> hdf5_series(const std::filesystem::path& file,
                                          const SeriesOrigin& origin,
                                          const SignalSelection& selection) {
  return std::make_unique<Hdf5Series>(file, origin, selection);
}

}  // namespace proofmass::coordinator
