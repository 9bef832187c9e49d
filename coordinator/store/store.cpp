#include "coordinator/store/store.hpp"

#include <fmt/format.h>

#include <charconv>
#include <system_error>
#include <utility>

#include "coordinator/store/detail/campaign_rows.hpp"
#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/file_system.hpp"
#include "coordinator/store/detail/result_rows.hpp"
#include "coordinator/store/detail/schema.hpp"
#include "coordinator/store/detail/statistic_rows.hpp"
#include "coordinator/store/detail/store_lock.hpp"
#include "core/campaign/dispersion.hpp"

namespace proofmass::coordinator {

using detail::Access;
using detail::Database;
using detail::Statement;
using detail::Transaction;

namespace {

constexpr std::size_t event_text_size_max = 2000;

// A file from elsewhere is data: nothing in its schema may call functions with side effects.
void configure(Database& database) {
  database.execute("PRAGMA trusted_schema = OFF; PRAGMA foreign_keys = ON");
}

void check_presence(const std::filesystem::path& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) {
    throw StoreError(fmt::format("campaign file = {} (does not exist)", path.string()));
  }
}

void check_absence(const std::filesystem::path& path) {
  std::error_code ignored;
  if (std::filesystem::exists(path, ignored)) {
    throw StoreError(fmt::format("campaign file = {} (exists already)", path.string()));
  }
}

// Removes an unfinished file, its rollback journal with it.
void remove_draft(const std::filesystem::path& draft) {
  std::error_code ignored;
  std::filesystem::remove(draft, ignored);
  std::filesystem::remove(std::filesystem::path(draft).concat("-journal"), ignored);
}

void write_draft(const std::filesystem::path& draft, const Campaign& campaign,
                 std::string_view definition) {
  Database database(draft, Access::create);
  configure(database);
  Transaction transaction(database);
  detail::migrate(database);
  detail::insert_campaign(database, campaign, definition);
  const Budget before = budget_before_calibration(campaign.scenario);
  detail::replace_budgets(database,
                          {.before = before, .after_worst = nullptr, .after_mean = nullptr});
  transaction.commit();
}

// The campaign file appears under its name complete, or not at all.
void make_campaign_file(const std::filesystem::path& path, const Campaign& campaign,
                        std::string_view definition) {
  const std::filesystem::path draft = std::filesystem::path(path).concat(".new");
  remove_draft(draft);
  try {
    write_draft(draft, campaign, definition);
  } catch (...) {
    remove_draft(draft);
    throw;
  }
  std::filesystem::rename(draft, path);
  detail::synchronise_directory_of(path);
}

void insert_event(const Database& database, std::string_view kind, std::string_view text) {
  database.prepare("INSERT INTO event (kind, text) VALUES (?, substr(?, 1, ?))")
      .run(kind, text, std::uint64_t{event_text_size_max});
  database.prepare("DELETE FROM event WHERE event_id <= last_insert_rowid() - 10000").run();
}

}  // namespace

struct Store::Parts {
  std::unique_ptr<detail::StoreLock> lock;  // Of a coordinator; a reader has none.
  Database database;

  explicit Parts(const std::filesystem::path& path);
  Parts(const std::filesystem::path& path, std::unique_ptr<detail::StoreLock> lock);
  ~Parts();
};

Store::Parts::Parts(const std::filesystem::path& path) : database(path, Access::read_only) {
  detail::check_campaign_file(database, path);
  detail::check_up_to_date(database, path);
  configure(database);
}

Store::Parts::Parts(const std::filesystem::path& path, std::unique_ptr<detail::StoreLock> held_lock)
    : lock(std::move(held_lock)), database(path, Access::read_write) {
  detail::check_campaign_file(database, path);
  configure(database);
  database.execute("PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL");
  Transaction transaction(database);
  detail::migrate(database);
  transaction.commit();
}

// Readers cannot open a file in WAL mode on read-only media, so that a closed one is in the other.
// With somebody reading, both steps fail at once and the log stays: nothing is lost by that.
Store::Parts::~Parts() {
  if (!lock) return;
  try {
    database.execute("PRAGMA busy_timeout = 0");
    database.execute("PRAGMA wal_checkpoint(TRUNCATE)");
    database.execute("PRAGMA journal_mode = DELETE");
  } catch (const StoreError&) {
    // The next coordinator finds the log and goes on from there.
  }
}

Store::Store(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
Store::~Store() = default;
Store::Store(Store&&) noexcept = default;
Store& Store::operator=(Store&&) noexcept = default;

Store Store::create(const std::filesystem::path& path, const Campaign& campaign,
                    std::string_view definition) {
  detail::check_directory_of(path);
  auto lock = std::make_unique<detail::StoreLock>(path);
  check_absence(path);
  make_campaign_file(path, campaign, definition);
  return Store(std::make_unique<Parts>(path, std::move(lock)));
}

Store Store::open(const std::filesystem::path& path) {
  check_presence(path);
  detail::check_directory_of(path);
  return Store(std::make_unique<Parts>(path, std::make_unique<detail::StoreLock>(path)));
}

Store Store::open_read_only(const std::filesystem::path& path) {
  check_presence(path);
  return Store(std::make_unique<Parts>(path));
}

std::string Store::name() const { return parts_->database.text("SELECT name FROM campaign"); }

std::uint64_t Store::seed() const {
  const std::string digits = parts_->database.text("SELECT seed FROM campaign");
  std::uint64_t seed = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), seed);
  PROOFMASS_EXPECT(error == std::errc() && end == digits.data() + digits.size());
  return seed;
}

std::uint64_t Store::num_runs() const {
  return static_cast<std::uint64_t>(parts_->database.integer("SELECT num_runs FROM campaign"));
}

std::string Store::definition() const {
  return parts_->database.text("SELECT definition FROM campaign");
}

std::string Store::model_version() const {
  return parts_->database.text("SELECT model_version FROM campaign");
}

EnvironmentTable Store::environment_table() const {
  return detail::read_environment_table(parts_->database);
}

std::vector<std::vector<double>> Store::table_columns(std::span<const std::size_t> elements) const {
  std::vector<std::vector<double>> columns;
  for (const std::size_t element : elements) {
    columns.push_back(detail::read_dispersion_values(parts_->database, drawn_names()[element]));
  }
  return columns;
}

void Store::extend(const Campaign& campaign, std::string_view definition) {
  detail::check_extension(parts_->database, campaign);
  Transaction transaction(parts_->database);
  detail::extend_campaign(parts_->database, campaign, definition);
  transaction.commit();
}

std::vector<RunRange> Store::finished_runs() const {
  Statement select =
      parts_->database.prepare("SELECT run_index FROM run_result ORDER BY run_index");
  std::vector<RunRange> ranges;
  while (select.step()) {
    const std::uint64_t run = select.count(0);
    if (!ranges.empty() && ranges.back().end() == run) {
      ++ranges.back().count;
    } else {
      ranges.push_back({.first = RunIndex{run}, .count = 1});
    }
  }
  return ranges;
}

CommitSummary Store::commit(std::span<const Delivery> deliveries) {
  const std::uint64_t num_runs_wanted = num_runs();
  for (const Delivery& delivery : deliveries) detail::check_delivery(delivery, num_runs_wanted);

  Database& database = parts_->database;
  Transaction transaction(database);
  detail::ResultRows results(database);
  Statement insert_delivery = database.prepare(
      "INSERT INTO delivery (run_index, worker, attempt, compute_s) VALUES (?, ?, ?, ?)");
  CommitSummary summary;
  for (const auto& [result, worker, attempt, compute_s] : deliveries) {
    if (results.insert(result)) {
      insert_delivery.run(result.run.value, worker, attempt, compute_s);
      ++summary.num_new;
      continue;
    }
    ++summary.num_duplicate;
    if (detail::are_equal(result, results.read(result.run))) continue;
    ++summary.num_contradicting;
    insert_event(database, "contradicting_result",
                 fmt::format("run={} worker={} attempt={}", result.run.value, worker, attempt));
  }
  transaction.commit();
  return summary;
}

void Store::for_each_result(const std::function<void(const RunResult&)>& visit) const {
  Statement row = detail::select_results(parts_->database);
  while (row.step()) visit(detail::read_result(row));
}

void Store::write_statistics(const CampaignStatistics& statistics, const Budget& before,
                             const Budget& after_worst, const Budget& after_mean) {
  const bool has_estimates = statistics.num_estimated > 0;
  Transaction transaction(parts_->database);
  detail::replace_statistics(parts_->database, statistics);
  detail::replace_budgets(parts_->database, {.before = before,
                                             .after_worst = has_estimates ? &after_worst : nullptr,
                                             .after_mean = has_estimates ? &after_mean : nullptr});
  transaction.commit();
}

void Store::record_event(std::string_view kind, std::string_view text) {
  Transaction transaction(parts_->database);
  insert_event(parts_->database, kind, text);
  transaction.commit();
}

}  // namespace proofmass::coordinator
