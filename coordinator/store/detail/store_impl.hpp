#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/file_place.hpp"
#include "coordinator/store/detail/rows.hpp"
#include "coordinator/store/detail/schema.hpp"
#include "coordinator/store/store.hpp"

namespace proofmass::coordinator {

namespace detail {

/// Settings of every connection to a campaign database. A file from elsewhere is data.
void configure(Database& database);

/// Writes all that the database of a file holds to an empty file, which is whole without a log.
/// @param on_part  See Database::copy_to().
/// @throws StoreError naming the file if a page of it is damaged, and else the draft.
void copy_whole(Database& database, const std::filesystem::path& file,
                const std::filesystem::path& draft, const std::function<void()>& on_part);

/// Prepares a connection to a campaign database for reading: checks the file, and if it is of an
/// older version goes on with a private copy, see Database::go_on_with_private_copy().
/// @throws StoreError as Store::open_read_only() does.
StoredKind prepare_reader(Database& database, const std::filesystem::path& file);

}  // namespace detail

struct Store::Impl {
  /// Opens a file for reading.
  explicit Impl(const std::filesystem::path& file);
  /// Opens a file for its coordinator.
  Impl(const std::filesystem::path& file, std::unique_ptr<detail::StoreLock> held_lock);
  ~Impl();

  /// Stores what `action` changes, durable in a file that has its name when it returns. If it
  /// throws, nothing is stored, or only in a file that has lost its name.
  void commit(const std::function<void(detail::Database&)>& action);
  /// As Store::check_place().
  void check_place();

  /// Folds the log into the file, which is whole without it afterwards. Does not wait for readers:
  /// returns why it could not. @throws StoreError if the disk does not take it.
  [[nodiscard]] std::optional<std::string> rest();

  std::filesystem::path path;
  std::unique_ptr<detail::StoreLock> lock;   ///< Of a coordinator; a reader has none.
  std::unique_ptr<detail::FilePlace> place;  ///< Of a coordinator. Closed after the database.
  detail::Database database;
  detail::StoredKind kind;
  std::optional<detail::EntryRows> rows;  ///< Prepared when they are first needed.
  bool is_log_lost = false;  ///< The file needed a log when it was opened; none was there.

  std::filesystem::path copy;  ///< Of a file that lost its name; see Store::check_place().

 private:
  void mark_log_as_needed();
  void write_copy();

  bool is_marked_ = false;          ///< The file itself, not only its log, says that it needs one.
  bool is_perhaps_marked_ = false;  ///< What the file says is not known to be that it needs none.
};

}  // namespace proofmass::coordinator
