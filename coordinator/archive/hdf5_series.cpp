#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "coordinator/archive/detail/hdf5_file.hpp"
#include "coordinator/archive/export.hpp"
#include "coordinator/archive/series_output.hpp"

namespace proofmass::coordinator {
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
