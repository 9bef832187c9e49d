#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/records.hpp"

namespace proofmass::coordinator::detail {

/// 16 hexadecimal digits: SQLite's integers have a sign.
[[nodiscard]] std::string hexadecimal(std::uint64_t value);

/// How a reason stands in the database: `out_of_memory`.
[[nodiscard]] std::string_view stored_name(wire::LossReason reason);

/// Workers as rows of `worker`, which other tables refer to by key.
class WorkerRows {
 public:
  explicit WorkerRows(const Database& database);

  void write(const WorkerJoined& joined);
  void write(const WorkerEnded& ended);

  /// The key of a worker; one that never joined gets a row without a name.
  [[nodiscard]] std::int64_t key_of(wire::SessionId session);

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

  const Database& database_;
  Statement select_key_;
  std::map<wire::SessionId, std::int64_t> keys_;  ///< Of rows that are there.
  std::map<std::int64_t, Count> counts_;
};

/// Sessions of the workers without an end.
[[nodiscard]] std::vector<wire::SessionId> read_attached_sessions(const Database& database);

}  // namespace proofmass::coordinator::detail
