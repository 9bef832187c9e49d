#include "coordinator/store/detail/database.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sqlite3.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>

#include "coordinator/store/campaign_record.hpp"
#include "coordinator/store/detail/file_place.hpp"
#include "coordinator/store/records.hpp"
#include "proto/link/whole_file.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator::detail {
namespace {

constexpr int sql_size_max = 1'000'000;  // Of a statement, a definition in the schema among them.

// One thread at a time uses a connection, so that SQLite need not lock it for each column.
int open_flags(Access access) {
  constexpr int common = SQLITE_OPEN_URI | SQLITE_OPEN_NOMUTEX;
  switch (access) {
    case Access::create:
    case Access::memory:
      return common | SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE;
    case Access::read_write:
    case Access::read_only:  // The name says that this file is read-only.
      return common | SQLITE_OPEN_READWRITE;
    case Access::immutable:
      break;
  }
  return common | SQLITE_OPEN_READONLY;
}

// An absolute path is never mistaken for `:memory:` or a URI. SQLite follows links to it, and keeps
// room for the ending `-journal` in 512 bytes.
std::string checked_path(const std::filesystem::path& path) {
  constexpr std::size_t size_max = 504;
  const std::filesystem::path absolute = std::filesystem::absolute(path);
  std::error_code ignored;
  const std::size_t size = std::filesystem::weakly_canonical(absolute, ignored).native().size();
  if (size <= size_max) return absolute.string();
  refuse_file(path,
              fmt::format("has a path of {} bytes, and SQLite opens none of more than {}: use "
                          "directories with shorter names",
                          size, size_max));
}

std::string name_of(const std::filesystem::path& path, Access access) {
  switch (access) {
    case Access::memory:
      return ":memory:";
    case Access::read_only:
      return file_uri(path, "mode=ro");
    case Access::immutable:
      return file_uri(path, "immutable=1");
    default:
      return checked_path(path);
  }
}

// Asked before the connection has a lock. SQLite takes a missing lock for one of somebody else.
bool has_locks(sqlite3* connection) {
  sqlite3_file* file = nullptr;
  sqlite3_file_control(connection, "main", SQLITE_FCNTL_FILE_POINTER, &file);
  if (file == nullptr || file->pMethods == nullptr) return true;
  errno = 0;
  if (file->pMethods->xLock(file, SQLITE_LOCK_SHARED) == SQLITE_OK) {
    (void)file->pMethods->xUnlock(file, SQLITE_LOCK_NONE);
    return true;
  }
  return errno != ENOLCK && errno != ENOSYS && errno != EOPNOTSUPP;
}

// SQLite applies a log to whatever file has the name. One that this program began is the file's.
std::string damage(const std::filesystem::path& file, bool had_log, std::string_view what) {
  if (had_log && has_log(file) && fault_without_log(file).empty()) {
    return fmt::format(
        "is damaged: {}; without its log {} it is in order: if the file was restored from a copy, "
        "the log is that of the file before it, and removing the log suffices",
        what, log_path(file).filename().string());
  }
  return fmt::format("is damaged: {}; restore it from a copy", what);
}

/// What SQLite noticed, which names no place, and what its check of the whole file finds first.
std::string corruption(const std::filesystem::path& file, bool had_log, const char* what) {
  const std::string fault = fault_without_log(file);
  const bool is_told = fault.empty() || fault == what;
  return damage(
      file, had_log,
      is_told ? std::string(what) : fmt::format("{}; PRAGMA integrity_check: {}", what, fault));
}

constexpr std::string_view log_out_of_reach =
    "has a log that only a user who may write to its directory can read";

constexpr std::string_view no_room_for_log =
    "needs a log or a journal beside it, and its directory is not writable; use a copy in a "
    "directory that is";

// SQLite keeps a log, and an index beside it; where it cannot make them, it says that it cannot
// open a file.
bool is_beside_no_place(const std::filesystem::path& file) {
  const std::string directory = wire::directory_of(log_path(file)).string();
  return ::faccessat(AT_FDCWD, file.c_str(), R_OK, AT_EACCESS) == 0 &&
         ::faccessat(AT_FDCWD, directory.c_str(), W_OK, AT_EACCESS) != 0;
}

// What a reader meets that must be written before anything can be read.
std::string explanation_of_readonly(int code, sqlite3* connection) {
  switch (code) {
    case SQLITE_READONLY_ROLLBACK:
      return "was being changed by a program that was killed; whoever writes to it next takes that "
             "back: resume the campaign";
    case SQLITE_READONLY_RECOVERY:
    case SQLITE_READONLY_CANTINIT:
      return std::string(log_out_of_reach);
    case SQLITE_READONLY_DIRECTORY:
      return std::string(no_room_for_log);
    default:
      return sqlite3_errmsg(connection);
  }
}

std::string explanation(int code, sqlite3* connection, const std::filesystem::path& file,
                        bool had_log) {
  switch (code & 0xff) {
    case SQLITE_NOTADB:
      return "is not an SQLite database";
    case SQLITE_CORRUPT:
      return corruption(file, had_log, sqlite3_errmsg(connection));
    case SQLITE_FULL:
      return fmt::format("{}; what was committed before is safe, free space and try again",
                         disk_full_text);
    case SQLITE_BUSY:
      return fmt::format("is locked by another program for more than {} s", busy_timeout_ms / 1000);
    case SQLITE_INTERRUPT:
      return "has more in its schema than a campaign has";
    case SQLITE_READONLY:
      return explanation_of_readonly(code, connection);
    case SQLITE_IOERR:
      return fmt::format("{}; what was committed before is safe", sqlite3_errmsg(connection));
    case SQLITE_CANTOPEN:
      if (is_beside_no_place(file)) {
        return std::string(has_log(file) ? log_out_of_reach : no_room_for_log);
      }
      return fmt::format("{}: {}", sqlite3_errmsg(connection),
                         std::strerror(sqlite3_system_errno(connection)));
    default:
      return sqlite3_errmsg(connection);
  }
}

constexpr int pages_per_part = 4096;  // 16 MB.

// With several steps, a writer in another process would begin the copy anew each time, unless a
// transaction holds the state that is copied. The end does not tell that a step found the file
// locked and copied nothing.
int copy_all(
    sqlite3* from, sqlite3* to, const char* name = "main", int num_pages = -1,
    const std::function<void()>& on_part = [] {}) {
  const std::unique_ptr<sqlite3_backup, int (*)(sqlite3_backup*)> backup(
      sqlite3_backup_init(to, name, from, "main"), &sqlite3_backup_finish);
  if (backup == nullptr) return sqlite3_errcode(to);
  int code = SQLITE_OK;
  while (code == SQLITE_OK) {
    on_part();
    code = sqlite3_backup_step(backup.get(), num_pages);
  }
  return code == SQLITE_DONE ? SQLITE_OK : code;
}

}  // namespace

void refuse_file(const std::filesystem::path& file, std::string_view what) {
  throw StoreError(fmt::format("campaign database = {} ({})", file.string(), what));
}

std::string file_uri(const std::filesystem::path& file, std::string_view parameter) {
  std::string uri = "file://";
  for (const char character : checked_path(file)) {
    const bool has_meaning = character == '%' || character == '?' || character == '#';
    uri += has_meaning ? fmt::format("%{:02X}", static_cast<int>(character))
                       : std::string(1, character);
  }
  return fmt::format("{}?{}", uri, parameter);
}

void Database::Close::operator()(sqlite3* connection) const { sqlite3_close_v2(connection); }

Database::Database(const std::filesystem::path& path, Access access)
    : path_(path),
      name_(name_of(path, access)),
      had_log_(access != Access::memory && has_log(path)) {
  open(access);
  const bool is_file = access != Access::memory && access != Access::immutable;
  if (is_file && !has_locks(connection_.get())) {
    if (access == Access::read_write) refuse(wire::no_locks_remedy);
    if (access == Access::read_only && has_journal(path)) {
      refuse("has a log or a journal, and no locks; copy all of its files to a local disk");
    }
    // Nobody can be writing to it, or knows the draft.
    name_ = file_uri(path, access == Access::create ? "nolock=1" : "mode=ro&immutable=1");
    open(access);
  }
  sqlite3* const connection = connection_.get();
  sqlite3_busy_timeout(connection, busy_timeout_ms);
  sqlite3_limit(connection, SQLITE_LIMIT_SQL_LENGTH, sql_size_max);
  const bool is_reader = access == Access::read_only || access == Access::immutable;
  if (!is_reader && sqlite3_db_readonly(connection, "main") != 0) {
    refuse("is not writable");
  }
}

void Database::open(Access access) {
  sqlite3* connection = nullptr;
  const int code = sqlite3_open_v2(name_.c_str(), &connection, open_flags(access), nullptr);
  connection_.reset(connection);
  if (code != SQLITE_OK) fail(code);
  sqlite3_extended_result_codes(connection, 1);
}

void Database::distrust_content() {
  const int code = sqlite3_db_config(connection_.get(), SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  if (code != SQLITE_OK) fail(code);
  execute("PRAGMA trusted_schema = OFF; PRAGMA cell_size_check = ON");
}

void Database::execute(const std::string& sql) {
  const int code = sqlite3_exec(connection_.get(), sql.c_str(), nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) fail(code);
}

bool Database::execute_unless_busy(const std::string& sql) {
  const int code = sqlite3_exec(connection_.get(), sql.c_str(), nullptr, nullptr, nullptr);
  if (code != SQLITE_OK && (code & 0xff) != SQLITE_BUSY) fail(code);
  return code == SQLITE_OK;
}

Statement Database::prepare(std::string_view sql) const {
  sqlite3_stmt* statement = nullptr;
  const int code = sqlite3_prepare_v2(connection_.get(), sql.data(), static_cast<int>(sql.size()),
                                      &statement, nullptr);
  if (code != SQLITE_OK) fail(code);
  return {*this, statement};
}

Statement Database::first_row(std::string_view sql) const {
  Statement statement = prepare(sql);
  if (!statement.step()) refuse_as_damaged(fmt::format("no row for {}", sql));
  return statement;
}

std::int64_t Database::integer(std::string_view sql) const { return first_row(sql).integer(0); }

std::string Database::text(std::string_view sql) const { return first_row(sql).text(0); }

std::uint64_t Database::count(std::string_view sql) const { return first_row(sql).count(0); }

std::int64_t Database::num_changes() const { return sqlite3_changes64(connection_.get()); }

std::int64_t Database::last_row() const { return sqlite3_last_insert_rowid(connection_.get()); }

bool Database::in_transaction() const { return sqlite3_get_autocommit(connection_.get()) == 0; }

void Database::copy_to(Database& copy, const std::function<void()>& on_part) {
  const ReadTransaction one_state(*this);
  (void)count("SELECT count(*) FROM sqlite_schema");  // The first read takes hold of the state.
  const int code =
      copy_all(connection_.get(), copy.connection_.get(), "main", pages_per_part, on_part);
  if (code == SQLITE_OK) return;
  if ((code & 0xff) == SQLITE_CORRUPT) {  // Found where it was read.
    refuse_as_damaged(sqlite3_errmsg(copy.connection_.get()));
  }
  copy.fail(code);
}

void Database::go_on_with_private_copy() {
  sqlite3* connection = nullptr;
  int code = sqlite3_open_v2("", &connection, open_flags(Access::create), nullptr);
  std::unique_ptr<sqlite3, Close> copy(connection);
  if (code == SQLITE_OK) {
    sqlite3_extended_result_codes(connection, 1);
    code = copy_all(connection_.get(), connection);
  }
  if (code != SQLITE_OK) refuse_copy(code);
  connection_ = std::move(copy);
  is_private_copy_ = true;
  // It is thrown away if anything fails.
  const int off =
      sqlite3_exec(connection_.get(), "PRAGMA journal_mode = OFF", nullptr, nullptr, nullptr);
  if (off != SQLITE_OK) fail(off);
}

void Database::attach(const Database& other, const std::string& name) {
  try {
    prepare("ATTACH ? AS ?").run(other.is_private_copy_ ? std::string() : other.name_, name);
  } catch (const StoreError&) {
    refuse_file(other.path_, sqlite3_errmsg(connection_.get()));
  }
  if (!other.is_private_copy_) return;
  const int code = copy_all(other.connection_.get(), connection_.get(), name.c_str());
  if (code != SQLITE_OK) other.refuse_copy(code);
}

std::uint64_t Database::log_size() const {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(log_path(path_), error);
  return error ? 0 : size;
}

void Database::wait_as_usual() { sqlite3_busy_timeout(connection_.get(), busy_timeout_ms); }

// The row of the pragma: whether somebody was in the way, frames of the log, frames in the file.
bool Database::fold_log(Fold fold) {
  Statement row = prepare(fold == Fold::all_and_empty_it ? "PRAGMA wal_checkpoint(TRUNCATE)"
                                                         : "PRAGMA wal_checkpoint(PASSIVE)");
  if (!row.step()) return false;
  return row.integer(0) == 0 && row.integer(1) == row.integer(2);
}

void Database::fold_log_at_close(bool is_folded) {
  sqlite3_db_config(connection_.get(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, is_folded ? 0 : 1,
                    nullptr);
}

void Database::refuse(std::string_view what) const {
  // It may quote the file.
  refuse_file(path_, wire::visible_text(what));
}

void Database::refuse_as_damaged(std::string_view what) const {
  refuse(damage(path_, had_log_, what));
}

void Database::refuse_copy(int code) const {
  refuse(
      fmt::format("is older than this program, which reads a copy of it; the copy cannot be made "
                  "in the temporary directory, which TMPDIR names: {}",
                  sqlite3_errstr(code & 0xff)));
}

void Database::fail(int code) const {
  const int kind = code & 0xff;
  if (is_private_copy_ &&
      (kind == SQLITE_FULL || kind == SQLITE_IOERR || kind == SQLITE_CANTOPEN)) {
    refuse_copy(code);
  }
  refuse(explanation(code, connection_.get(), path_, had_log_));
}

Transaction::Transaction(Database& database) : database_(database) {
  database_.execute("BEGIN IMMEDIATE");
}

namespace {

// SQLite ends a transaction by itself on a full disk, so that there may be none to roll back.
void roll_back(Database& database) {
  if (!database.in_transaction()) return;
  try {
    database.execute("ROLLBACK");
  } catch (const StoreError&) {
    // The next BEGIN reports what is wrong with the connection.
  }
}

}  // namespace

Transaction::~Transaction() { roll_back(database_); }

void Transaction::commit() { database_.execute("COMMIT"); }

ReadTransaction::ReadTransaction(Database& database)
    : database_(database), is_within_another_(database.in_transaction()) {
  if (!is_within_another_) database_.execute("BEGIN");
}

ReadTransaction::~ReadTransaction() {
  if (!is_within_another_) roll_back(database_);
}

StepLimit::StepLimit(const Database& database, int num_steps) : database_(database) {
  sqlite3_progress_handler(
      database_.connection_.get(), num_steps, [](void*) { return 1; }, nullptr);
}

StepLimit::~StepLimit() {
  sqlite3_progress_handler(database_.connection_.get(), 0, nullptr, nullptr);
}

std::string places(int count) {
  std::string text = "?";
  for (int i = 1; i < count; ++i) text += ", ?";
  return text;
}

}  // namespace proofmass::coordinator::detail
