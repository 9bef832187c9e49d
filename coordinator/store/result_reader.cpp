#include "coordinator/store/result_reader.hpp"

#include <fmt/format.h>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/result_rows.hpp"

namespace proofmass::coordinator {

struct ResultReader::Impl {
  const detail::Database& database;
  detail::Statement row;
  std::optional<std::uint64_t> num_runs;  // Of the campaign; read with the first result.
  std::optional<RunIndex> last;
};

ResultReader::ResultReader(const detail::Database& database)
    : impl_(std::make_unique<Impl>(database, detail::select_results(database))) {}

ResultReader::ResultReader(const detail::Database& database, RunRange runs)
    : impl_(std::make_unique<Impl>(database, detail::select_results_in_range(database))) {
  impl_->row.bind_all(runs.first.value, runs.end());
}

ResultReader::~ResultReader() = default;
ResultReader::ResultReader(ResultReader&&) noexcept = default;
ResultReader& ResultReader::operator=(ResultReader&&) noexcept = default;

std::optional<RunResult> ResultReader::next() {
  if (!impl_->row.step()) return std::nullopt;
  // A coordinator may raise the number of runs meanwhile. Once the first row is there, this query
  // is of the same state of the file.
  if (!impl_->num_runs) {
    impl_->num_runs = impl_->database.count("SELECT num_runs FROM campaign");
  }
  const RunResult result = detail::read_result(impl_->row);
  if (impl_->last && !(*impl_->last < result.run)) {
    impl_->database.refuse_as_damaged(fmt::format("result of run {} comes after that of run {}",
                                                  result.run.value, impl_->last->value));
  }
  if (result.run.value >= *impl_->num_runs) {
    impl_->database.refuse_as_damaged(
        fmt::format("result of run {}, of {} there are", result.run.value, *impl_->num_runs));
  }
  impl_->last = result.run;
  return result;
}

}  // namespace proofmass::coordinator
