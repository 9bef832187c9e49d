#include "coordinator/store/detail/store_impl.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <cstdint>
#include <ctime>
#include <utility>

#include "coordinator/store/detail/file_place.hpp"
#include "core/model.hpp"
#include "proto/link/machine.hpp"

namespace proofmass::coordinator {

using detail::Access;
using detail::Database;
using detail::Transaction;

namespace {

constexpr std::uint64_t usual_log_size = std::uint64_t{4} << 20;

bool says_that_log_is_needed(const Database& database) {
  return database.text("PRAGMA journal_mode") == "wal" &&
         database.integer("SELECT is_log_needed FROM campaign") != 0;
}

constexpr std::string_view reader_in_the_way =
    "somebody reads an old state of the file, and its log is still needed";
constexpr std::string_view writer_in_the_way =
    "another program is writing to the file, and its log is still needed";

// Entering and leaving the mode of write-ahead logs writes one page, of which one sector changes,
// so that nothing can be torn. A journal beside the file would be in the way of every reader if the
// disk failed then, and so there is none.
constexpr const char* without_log = "PRAGMA journal_mode = MEMORY";
constexpr const char* with_log = "PRAGMA journal_mode = WAL";

/// While it lives, whatever needs a lock that another connection has fails at once.
class ShortWait {
 public:
  explicit ShortWait(Database& database) : database_(database) {
    database_.execute("PRAGMA busy_timeout = 0");
  }
  ~ShortWait() { database_.wait_as_usual(); }
  ShortWait(const ShortWait&) = delete;
  ShortWait& operator=(const ShortWait&) = delete;

 private:
  Database& database_;
};

// The log comes and goes while a coordinator works, and it is there whenever a file says that it
// needs one. So a file that says so, before and after no log was seen, lacks it.
void check_that_log_is_there(const Database& database, const std::filesystem::path& file) {
  for (int i = 0; i < 3; ++i) {
    if (!says_that_log_is_needed(database) || detail::has_log(file)) return;
  }
  database.refuse(fmt::format(
      "lacks its log {}: results may be missing; copy both files, or make copies with `proofmass "
      "backup`; resuming the campaign computes what is missing",
      detail::log_path(file).filename().string()));
}

bool is_older(const Database& database) {
  return database.integer("PRAGMA user_version") < detail::schema_version();
}

// Brought up to date, the file would be lost to the older program, which alone has its model.
void require_own_model(const Database& database, const Model& model) {
  const std::string stored = database.text("SELECT model_version FROM campaign");
  if (stored == model.version()) return;
  database.refuse(
      fmt::format("is of the model {}, and this program has {}: the program that made it can go on "
                  "with it",
                  stored, model.version()));
}

// First everything else, then the mark alone: whenever the file says that it needs no log, all is
// in it, and whenever it says that it needs one, the log is there.
std::optional<std::string> bring_to_rest(Database& database) {
  if (!database.fold_log(detail::Fold::what_no_reader_needs)) return std::string(reader_in_the_way);
  if (!database.execute_unless_busy("UPDATE campaign SET is_log_needed = 0 WHERE is_log_needed")) {
    return std::string(writer_in_the_way);
  }
  if (!database.fold_log(detail::Fold::all_and_empty_it)) return std::string(reader_in_the_way);
  return std::nullopt;
}

// Checks the rows as well if no coordinator ended in order since the file was opened for writing: a
// file whose journal is still a write-ahead log. Takes some 1 s for a million runs.
void check_after_unclean_end(const Database& database) {
  if (database.text("PRAGMA journal_mode") != "wal") return;
  const std::string finding = database.text("PRAGMA quick_check(1)");
  if (finding == "ok") return;
  database.refuse_as_damaged(finding);
}

// A run without a delivery would be lent again and come back as a second result, and a result of a
// run that there is not would stand for one that is missing.
void check_results(const Database& database, const detail::RowCounts& counts) {
  const std::uint64_t num_runs = database.count("SELECT num_runs FROM campaign");
  const std::uint64_t end = database.count("SELECT ifnull(max(run_index) + 1, 0) FROM run_result");
  if (end > num_runs) {
    database.refuse_as_damaged(fmt::format("result of run {}, of {} there are", end - 1, num_runs));
  }
  const auto num_rows = [&](const std::string& table) {
    const auto found = counts.find(table);
    return found == counts.end() ? 0 : found->second;
  };
  if (num_rows("run_result") == num_rows("delivery")) return;
  database.refuse_as_damaged(
      fmt::format("results = {}, deliveries = {}", num_rows("run_result"), num_rows("delivery")));
}

// The file stays as it is.
void migrate_privately(Database& database, const detail::StoredKind& kind) {
  database.go_on_with_private_copy();
  database.distrust_content();
  Transaction transaction(database);
  detail::migrate(database, *kind.model, kind.results);
  transaction.commit();
  database.execute("PRAGMA query_only = ON");  // What would be written is lost.
}

}  // namespace

namespace detail {

void configure(Database& database) {
  database.distrust_content();
  database.execute("PRAGMA foreign_keys = ON");
}

void copy_whole(Database& database, const std::filesystem::path& file,
                const std::filesystem::path& draft, const std::function<void()>& on_part) {
  Database copy(draft, Access::create);
  database.copy_to(copy, on_part);
  copy.execute("PRAGMA cell_size_check = ON");
  // Nobody shall rely on the copy of a damaged file, which is the one to be named.
  copy.name_in_messages(file);
  (void)check_all_pages(copy);
  copy.name_in_messages(draft);
  // What is copied may say that there is a log.
  copy.execute("PRAGMA journal_mode = DELETE; UPDATE campaign SET is_log_needed = 0");
}

StoredKind prepare_reader(Database& database, const std::filesystem::path& file) {
  configure(database);
  StoredKind kind = check_campaign_file(database);
  if (is_older(database)) {
    migrate_privately(database, kind);
  } else {
    check_that_log_is_there(database, file);
  }
  return kind;
}

}  // namespace detail

Store::Impl::Impl(const std::filesystem::path& file)
    : path(file), database(file, Access::read_only), kind(detail::prepare_reader(database, file)) {}

Store::Impl::Impl(const std::filesystem::path& file, std::unique_ptr<detail::StoreLock> held_lock)
    : path(file),
      lock(std::move(held_lock)),
      place(std::make_unique<detail::FilePlace>(file)),
      database(file, Access::read_write) {
  // The log may be that of another file: until all is checked, nothing of it may reach this one.
  database.fold_log_at_close(false);
  detail::configure(database);
  kind = detail::check_campaign_file(database);
  // Before anything is changed: a file that cannot be served is left as it is.
  if (is_older(database)) require_own_model(database, *kind.model);
  const detail::RowCounts counts = detail::check_all_pages(database);
  check_after_unclean_end(database);
  const bool has_log = detail::has_log(file);
  if (database.text("PRAGMA journal_mode") != "wal") database.execute(without_log);
  database.execute(with_log);
  database.execute("PRAGMA synchronous = FULL");
  // A log that had to grow gives the disk its space back when it begins anew.
  database.execute(fmt::format("PRAGMA journal_size_limit = {}", usual_log_size));
  Transaction transaction(database);
  detail::migrate(database, *kind.model, kind.results);
  transaction.commit();
  check_results(database, counts);
  is_perhaps_marked_ = says_that_log_is_needed(database);
  is_log_lost = is_perhaps_marked_ && !has_log;
  place->remember_log();
  check_place();
  database.fold_log_at_close(true);
}

// Readers cannot open a file in WAL mode on read-only media, so that a closed one is in the other.
// With somebody reading, a step fails at once and the log stays: nothing is lost by that.
Store::Impl::~Impl() {
  if (!place) return;
  try {
    check_place();
    rows.reset();
    if (!rest()) {
      database.execute("PRAGMA busy_timeout = 0");
      database.execute(without_log);
      return;
    }
  } catch (const StoreError&) {
    // The next coordinator finds the log, or the copy, and goes on from there.
  }
  // The file says that it needs its log, of which SQLite may think that all is in the file. Or what
  // has the name now, and the log beside it, are not ours.
  if (is_perhaps_marked_ || place->is_lost()) database.fold_log_at_close(false);
}

void Store::Impl::check_place() {
  const std::string_view loss = place ? place->look() : std::string_view();
  if (loss.empty()) return;
  // What is left of a truncated file is of no use with pages of its log in it.
  if (place->is_truncated()) database.refuse(loss);
  try {
    if (copy.empty()) write_copy();
  } catch (const StoreError& error) {
    database.refuse(
        fmt::format("{}, and a copy cannot be written beside it: {}; do not stop this "
                    "program before that is mended",
                    loss, error.what()));
  }
  // A log of what has the name now would be applied to the copy.
  const std::filesystem::path& name = place->path();
  const std::string removal =
      detail::has_log(name)
          ? fmt::format("rm {} && ", wire::shell_word(detail::log_path(name).string()))
          : std::string();
  database.refuse(fmt::format(
      "{}; {} has all that was acknowledged: stop this program, run `{}mv --backup {} {}`, and "
      "start it again",
      loss, copy.string(), removal, wire::shell_word(copy.string()),
      wire::shell_word(name.string())));
}

// The log is first folded in, if nobody is in the way: whoever has the file under another name then
// finds all results in it, too.
void Store::Impl::write_copy() {
  rows.reset();
  try {
    (void)rest();
  } catch (const StoreError&) {
    // The copy has what the log has.
  }
  const std::filesystem::path& name = place->path();
  const std::filesystem::path wanted =
      name.parent_path() / fmt::format("{}.recovered-{:%Y%m%dT%H%M%SZ}{}", name.stem().string(),
                                       fmt::gmtime(std::time(nullptr)), name.extension().string());
  detail::check_directory_of(wanted);
  detail::appear_complete(wanted, [&](const std::filesystem::path& draft) {
    detail::copy_whole(database, path, draft, [] {});
  });
  copy = wanted;
  place->remove_own_log();
}

void Store::Impl::commit(const std::function<void(Database&)>& action) {
  check_place();
  mark_log_as_needed();
  Transaction transaction(database);
  action(database);
  transaction.commit();
  check_place();
}

// The mark reaches the file itself before anything that a copy of the file alone would lack. A
// reader of an old state may hold it up: the next change tries again.
void Store::Impl::mark_log_as_needed() {
  if (!place || is_marked_) return;
  is_perhaps_marked_ = true;
  database.execute("UPDATE campaign SET is_log_needed = 1 WHERE NOT is_log_needed");
  is_marked_ = database.fold_log(detail::Fold::what_no_reader_needs);
}

std::optional<std::string> Store::Impl::rest() {
  if (!is_perhaps_marked_ && database.log_size() == 0) return std::nullopt;
  is_marked_ = false;
  is_perhaps_marked_ = true;
  const ShortWait nobody_is_waited_for(database);
  const std::optional<std::string> reason = bring_to_rest(database);
  is_perhaps_marked_ = reason.has_value();
  return reason;
}

}  // namespace proofmass::coordinator
