#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "proto/link/whole_file.hpp"
#include "worker/execution/execution.hpp"

namespace proofmass::worker {

/// A file of results that no coordinator has acknowledged, for the worker that comes after this
/// one: those that have waited for their acknowledgement from one look to the next, and all that
/// are left at the end. So a coordinator that answers costs no writing, and a worker that is killed
/// while none does loses little.
///
/// It begins with a line that names the model. Then come records: size of the payload (32 bits) and
/// its checksum (64 bits), little endian, and the payload, an encoded message with results of one
/// campaign and attempt. What a process that dies leaves unfinished at the end is dropped by the
/// next one.
class Spool {
 public:
  static constexpr std::uint64_t default_size_max = std::uint64_t{256} << 20;

  /// Opens or makes the file and reads what it holds.
  ///
  /// @param model     is_name() holds; a spool of another model is set aside.
  /// @param size_max  Bytes that the file may have.
  /// @throws Error reading `spool = PATH (rule)` if it cannot be opened, read, written or set
  ///         aside, is another worker's, or is no spool.
  Spool(std::filesystem::path path, std::string_view model,
        std::uint64_t size_max = default_size_max);
  ~Spool();  ///< Removes the file if it holds nothing.

  /// The results that it held when it was opened.
  [[nodiscard]] const std::vector<wire::LeasedResult>& former_results() const {
    return former_results_;
  }
  /// Where the spool of another model is now that had its name; empty if there was none.
  [[nodiscard]] const std::filesystem::path& former_spool() const { return former_spool_; }
  /// Bytes at its end that were no records and have been dropped.
  [[nodiscard]] std::uint64_t num_bytes_dropped() const { return num_bytes_dropped_; }

  /// How many of these results it does not hold.
  [[nodiscard]] std::size_t num_missing(
      const std::vector<wire::LeasedResult>& unacknowledged) const;
  /// To be called now and then with the results that are not acknowledged. Returns why they could
  /// not be written, if so, as `spool = PATH (reason)`; they stay in memory, and the next call
  /// tries again. What is written survives the process and the machine.
  [[nodiscard]] std::optional<std::string> look(
      const std::vector<wire::LeasedResult>& unacknowledged);
  /// Writes all results at the end, when they will not stay in memory; returns why some could not
  /// be written, if so.
  [[nodiscard]] std::optional<std::string> finish(
      const std::vector<wire::LeasedResult>& unacknowledged);

  [[nodiscard]] std::uint64_t size() const { return size_; }  ///< Bytes.
  [[nodiscard]] bool is_empty() const { return size_ <= header_.size(); }

 private:
  [[nodiscard]] std::string message(std::string_view reason) const;
  void open();
  void read();
  void set_aside(std::string_view model);
  void read_records(std::string_view content);
  void clear();
  /// The reason if it cannot be written; then the file is as before.
  [[nodiscard]] std::optional<std::string> write(std::string_view bytes);

  std::filesystem::path path_;
  std::string header_;
  std::uint64_t size_max_;
  wire::Descriptor file_;
  std::uint64_t size_ = 0;
  std::filesystem::path former_spool_;
  std::uint64_t num_bytes_dropped_ = 0;
  std::vector<wire::LeasedResult> former_results_;
  std::set<RunKey> spooled_;
  std::set<RunKey> seen_;  ///< At the look before.
};

}  // namespace proofmass::worker
