#include "coordinator/store/result_reader.hpp"

#include <fmt/format.h>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/result_rows.hpp"

namespace proofmass::coordinator {

struct ResultReader::Parts {
  const detail::Database& database;
  detail::Statement row;
  std::optional<std::uint64_t> num_runs;  // Of the campaign; read with the first result.
  std::optional<RunIndex> last;
};

ResultReader::ResultReader(const detail::Database& database)
    : parts_(std::make_unique<Parts>(database, detail::select_results(database))) {}

ResultReader::ResultReader(const detail::Database& database, RunRange runs)
    : parts_(std::make_unique<Parts>(database, detail::select_results_in_range(database))) {
  parts_->row.bind_all(runs.first.value, runs.end());
}

ResultReader::~ResultReader() = default;
ResultReader::ResultReader(ResultReader&&) noexcept = default;
ResultReader& ResultReader::operator=(ResultReader&&) noexcept = default;

std::optional<RunResult> ResultReader::next() {
  if (!parts_->row.step()) return std::nullopt;
  // A coordinator may raise the number of runs meanwhile. Once the first row is there, this query
  // is of the same state of the file.
  if (!parts_->num_runs) {
    parts_->num_runs = parts_->database.count("SELECT num_runs FROM campaign");
  }
  const RunResult result = detail::read_result(parts_->row);
  if (parts_->last && !(*parts_->last < result.run)) {
    parts_->database.refuse_as_damaged(fmt::format("result of run {} comes after that of run {}",
                                                   result.run.value, parts_->last->value));
  }
  if (result.run.value >= *parts_->num_runs) {
    parts_->database.refuse_as_damaged(
        fmt::format("result of run {}, of {} there are", result.run.value, *parts_->num_runs));
  }
  parts_->last = result.run;
  return result;
}

}  // namespace proofmass::coordinator
