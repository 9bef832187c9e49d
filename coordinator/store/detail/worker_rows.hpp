#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/records.hpp"

namespace proofmass::coordinator::detail {

/// 16 hexadecimal digits: SQLite's integers have a sign.
[[nodiscard]] std::string hexadecimal(std::uint64_t value);

/// How a reason stands in the database: `out_of_memory`.
[[nodiscard]] std::string_view stored_name(wire::LossReason reason);

/// Rows of `worker` that are one worker's. All further workers share one more.
inline constexpr std::int64_t num_workers_max = 100'000;

/// Workers as rows of `worker`, which other tables refer to by key.
class WorkerRows {
 public:
  explicit WorkerRows(const Database& database);

  void write(const WorkerJoined& joined);
  void write(const WorkerEnded& ended);

  /// The key of a worker; one that never joined gets a row without a name. Further workers than
  /// num_workers_max have the key of the row `further workers`, which counts the results of all.
  [[nodiscard]] std::int64_t key_of(wire::SessionId session);

  /// Whether the row of further workers was made since the last call.
  [[nodiscard]] bool take_overflow() { return std::exchange(has_overflowed_, false); }

  /// Name of a worker, for people.
  [[nodiscard]] std::string name_of(wire::SessionId session);

  /// Counts a result of a worker; in the table after write_counts().
  void count_result(std::int64_t worker, double compute_s);
  /// @param now_unix_s  Stands for the time of all of them.
  void write_counts(std::int64_t now_unix_s);

 private:
  struct Count {
    std::int64_t num_results = 0;
    double compute_s = 0.0;
  };

  /// The key of a row that is there.
  [[nodiscard]] std::optional<std::int64_t> stored_key(wire::SessionId session);
  /// Keys are given in order and never given up.
  [[nodiscard]] bool is_full() const;
  [[nodiscard]] std::int64_t key_of_further();

  const Database& database_;
  Statement select_key_;
  std::map<wire::SessionId, std::int64_t> keys_;  ///< Of rows that are there.
  bool has_overflowed_ = false;
  std::map<std::int64_t, Count> counts_;
};

/// Sessions of the workers without an end.
[[nodiscard]] std::vector<wire::SessionId> read_attached_sessions(const Database& database);

}  // namespace proofmass::coordinator::detail
