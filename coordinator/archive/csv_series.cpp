#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <iterator>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "coordinator/archive/series_output.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator {
namespace {

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

/// Text that goes to a file, which appears when it is complete.
class SeriesFile {
 public:
  /// @throws Error `output = path (cannot be written: why)`; so do all below.
  explicit SeriesFile(const std::filesystem::path& path) : file_("output", path) {
    descriptor_ = file_.open();
  }
  ~SeriesFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  SeriesFile(const SeriesFile&) = delete;
  SeriesFile& operator=(const SeriesFile&) = delete;

  void write(std::string_view text) {
    constexpr std::size_t buffer_size = 1 << 18;
    buffer_ += text;
    if (buffer_.size() >= buffer_size) flush();
  }
  /// Writes what is left and closes the file.
  void write_rest() {
    flush();
    if (descriptor_ >= 0 && ::close(std::exchange(descriptor_, -1)) != 0) file_.fail(errno);
  }
  /// Gives the file its name, replacing one that has it.
  void publish() { file_.publish(wire::IfThere::replace); }

 private:
  void flush() {
    std::string_view rest = buffer_;
    while (!rest.empty()) {
      const ssize_t size = ::write(descriptor_, rest.data(), rest.size());
      if (size < 0 && errno != EINTR) file_.fail(errno);
      if (size > 0) rest.remove_prefix(static_cast<std::size_t>(size));
    }
    buffer_.clear();
  }

  wire::DraftFile file_;
  int descriptor_ = -1;
  std::string buffer_;
};

class CsvSeries final : public SeriesOutput {
 public:
  CsvSeries(std::filesystem::path directory, RunIndex run, const SignalSelection& selection)
      : directory_(std::move(directory)), run_(run), selection_(selection) {}

  void add(const RecordedSample& sample) override {
    if (!selection_.has_session(sample.session)) return;
    if (files_.empty() || session_ != sample.session) begin_session(sample.session);
    line_.clear();
    const auto end = std::back_inserter(line_);
    fmt::format_to(end, "{}", sample.time_s);
    for (const SignalSelection::Group& group : selection_.groups()) {
      for (const double value :
           sample.values.subspan(group.first_value, group.info->signals.size())) {
        fmt::format_to(end, ",{}", value);
      }
    }
    fmt::format_to(end, "\r\n");
    files_.back()->write({line_.data(), line_.size()});
  }

  void finish() override {
    // A full disk is found before any file appears.
    for (const auto& file : files_) file->write_rest();
    for (const auto& file : files_) file->publish();
  }

 private:
  void begin_session(std::size_t index) {
    if (!files_.empty()) files_.back()->write_rest();
    session_ = index;
    const RecordedSession& session = selection_.recording().sessions[index];
    files_.push_back(std::make_unique<SeriesFile>(csv_series_file(directory_, run_, session)));
    files_.back()->write(series_heading(selection_));
  }

  std::filesystem::path directory_;
  RunIndex run_;
  const SignalSelection& selection_;
  std::size_t session_ = 0;                         ///< The session of the last file.
  std::vector<std::unique_ptr<TextOutput>> files_;  ///< One a session; at most one is open.
  fmt::memory_buffer line_;
};

}  // namespace

std::filesystem::path csv_series_file(const std::filesystem::path& directory, RunIndex run,
                                      const RecordedSession& session) {
  return directory / fmt::format("run{}_{}.csv", run.value, session.name);
}

std::unique_ptr<SeriesOutput> csv_series(const std::filesystem::path& directory, RunIndex run,
                                         const SignalSelection& selection) {
  return std::make_unique<CsvSeries>(directory, run, selection);
}

}  // namespace proofmass::coordinator
