#include "coordinator/store/store.hpp"

#include <fmt/format.h>

#include <functional>
#include <optional>
#include <utility>
#include <variant>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/file_place.hpp"
#include "coordinator/store/detail/rows.hpp"
#include "coordinator/store/detail/schema.hpp"
#include "coordinator/store/detail/store_impl.hpp"
#include "core/model.hpp"
#include "proto/link/faults.hpp"
#include "proto/model_program/described_model.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {

using detail::Access;
using detail::Database;
using detail::Transaction;

namespace {

// Lock and log go by the name of the file: by another name it has others, and both would write.
void check_that_name_is_the_only_one(const std::filesystem::path& path) {
  std::error_code ignored;
  const std::uintmax_t num_names = std::filesystem::hard_link_count(path, ignored);
  if (num_names == 1) return;
  detail::refuse_file(path, fmt::format("has {} names (hard links), must have one; make copies "
                                        "instead",
                                        num_names));
}

// Lock and draft are named after the file, and would be made in a directory without it.
void check_name(const std::filesystem::path& path) {
  if (!path.has_filename()) detail::refuse_file(path, "names no file");
}

void check_deliveries(std::span<const Entry> entries, const ResultSchema& results,
                      std::uint64_t num_runs) {
  for (const Entry& entry : entries) {
    const auto* delivery = std::get_if<Delivery>(&entry);
    if (delivery != nullptr) detail::check_delivery(*delivery, results, num_runs);
  }
}

/// @param fill  Writes what a new campaign does not have, in transactions of its own.
void write_draft(const std::filesystem::path& draft, const Campaign& campaign,
                 std::string_view definition, const std::function<void(Database&)>& fill) {
  Database database(draft, Access::create);
  detail::configure(database);
  database.execute("PRAGMA synchronous = OFF");  // It is made durable before it gets its name.
  Transaction transaction(database);
  detail::migrate(database, campaign.model(), campaign.results());
  detail::insert_campaign(database, campaign, definition);
  detail::replace_budgets(database, campaign.error_budget(), {});
  transaction.commit();
  fill(database);
}

}  // namespace

Store::Store(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

Store::~Store() = default;
Store::Store(Store&&) noexcept = default;
Store& Store::operator=(Store&&) noexcept = default;

Store Store::create_filled(const std::filesystem::path& path, const Campaign& campaign,
                           std::string_view definition,
                           const std::function<void(detail::Database&)>& fill) {
  check_name(path);
  detail::check_directory_of(path);
  auto lock = std::make_unique<detail::StoreLock>(path);
  detail::check_absence(path);
  detail::appear_complete(path, [&](const std::filesystem::path& draft) {
    write_draft(draft, campaign, definition, fill);
  });
  return Store(std::make_unique<Impl>(path, std::move(lock)));
}

Store Store::create(const std::filesystem::path& path, const Campaign& campaign,
                    std::string_view definition) {
  return create_filled(path, campaign, definition, [](Database&) {});
}

Store Store::create_with_results(const std::filesystem::path& path, const Campaign& campaign,
                                 std::string_view definition, bool is_number_fixed,
                                 const std::function<std::vector<Entry>()>& next_entries) {
  return create_filled(path, campaign, definition, [&](Database& database) {
    Transaction transaction(database);
    if (!is_number_fixed) {
      database.execute("UPDATE campaign SET num_runs_fixed = NULL");
      detail::write_table_digest(database, campaign.model());
    }
    const ResultSchema results = campaign.results();
    detail::EntryRows rows(database, results);
    for (std::vector<Entry> entries; !(entries = next_entries()).empty();) {
      check_deliveries(entries, results, campaign.num_runs);
      (void)rows.write(entries);
    }
    transaction.commit();
  });
}

Store Store::open(const std::filesystem::path& path) {
  detail::check_presence(path);
  check_that_name_is_the_only_one(path);
  detail::check_directory_of(path);
  Store store(std::make_unique<Impl>(path, std::make_unique<detail::StoreLock>(path)));
  if (store.impl_->is_log_lost) {
    store.record_event("log_lost", "results that were not in the file itself are missing");
  }
  return store;
}

Store Store::open_read_only(const std::filesystem::path& path) {
  detail::check_presence(path);
  return Store(std::make_unique<Impl>(path));
}

void Store::check_absence(const std::filesystem::path& path) { detail::check_absence(path); }

wire::CampaignId Store::id() const {
  return {static_cast<std::uint64_t>(impl_->database.integer("SELECT campaign_uid FROM campaign"))};
}

std::string Store::name() const { return impl_->database.text("SELECT name FROM campaign"); }

std::uint64_t Store::seed() const { return detail::read_seed(impl_->database); }

std::uint64_t Store::num_runs() const {
  return impl_->database.count("SELECT num_runs FROM campaign");
}

std::string Store::definition() const {
  return impl_->database.text("SELECT definition FROM campaign");
}

const Model& Store::model() const { return *impl_->kind.model; }

const ResultSchema& Store::schema() const { return impl_->kind.results; }

std::string Store::model_version() const {
  const std::string version = impl_->database.text("SELECT model_version FROM campaign");
  // It is shown, and compared with ours, which has no control characters.
  if (wire::visible_text(version) == version) return version;
  impl_->database.refuse_as_damaged(fmt::format("model_version = {}", version));
}

std::uint64_t Store::reference_digest() const {
  return detail::reference_digest_in(impl_->database,
                                     impl_->database.text("SELECT reference_digest FROM campaign"));
}

std::uint64_t Store::reference_digest_for(const Model& model) const {
  return wire::current_reference_digest(
      model, {.version = model_version(),
              .description = impl_->database.text("SELECT model_description FROM campaign"),
              .reference_digest = reference_digest()});
}

std::string Store::build() const { return impl_->database.text("SELECT build FROM campaign"); }

std::string Store::created_utc() const {
  return impl_->database.text("SELECT created_utc FROM campaign");
}

std::string Store::owner() const { return impl_->database.text("SELECT owner FROM campaign"); }

void Store::set_owner(std::string_view owner) {
  impl_->commit([&](Database& database) {
    database.prepare("UPDATE campaign SET owner = ?").run(owner);
    detail::write_table_digest(database, model());
  });
}

std::string Store::table_digest() const {
  return impl_->database.text("SELECT table_digest FROM campaign");
}

std::string Store::computed_table_digest() const {
  return detail::compute_table_digest(impl_->database, model());
}

std::vector<Comparison> Store::write(std::span<const Entry> entries) {
  check_deliveries(entries, schema(), num_runs());
  std::vector<Comparison> comparisons;
  try {
    impl_->commit([&](Database& database) {
      if (!impl_->rows) impl_->rows.emplace(database, schema());
      comparisons = impl_->rows->write(entries);
      wire::kill_point(wire::KillPoint::before_commit);
    });
  } catch (...) {
    impl_->rows.reset();  // It knows of rows that are rolled back.
    throw;
  }
  return comparisons;
}

std::optional<std::string> Store::rest() {
  impl_->check_place();
  return impl_->rest();
}

void Store::check_place() { impl_->check_place(); }

bool Store::is_abandoned() const {
  const bool is_lost = impl_->place && impl_->place->is_lost();
  return is_lost && (impl_->place->is_truncated() || !impl_->copy.empty());
}

std::vector<Comparison> Store::commit(std::span<const Delivery> deliveries) {
  return write(std::vector<Entry>(deliveries.begin(), deliveries.end()));
}

void Store::for_each_result(const std::function<void(const RunResult&)>& visit) const {
  ResultReader reader = results();
  while (const std::optional<RunResult> result = reader.next()) visit(*result);
}

ResultReader Store::results() const { return {impl_->database, schema()}; }

ResultReader Store::results(RunRange runs) const { return {impl_->database, schema(), runs}; }

void Store::refuse_as_damaged(std::string_view what) const {
  impl_->database.refuse_as_damaged(what);
}

void Store::record_event(std::string_view kind, std::string_view text) {
  const Entry event = EventEntry{.kind = std::string(kind), .text = std::string(text)};
  write({&event, 1});
}

void Store::read_one_state(const std::function<void()>& read) const {
  const detail::ReadTransaction transaction(impl_->database);
  read();
}

std::uint64_t Store::log_size() const { return impl_->database.log_size(); }

void Store::check_integrity() const {
  read_one_state([&] { detail::check_integrity(impl_->database, impl_->kind); });
}

void Store::write_plain(const std::filesystem::path& draft) const {
  Database plain(draft, Access::create);
  plain.attach(impl_->database, "source");
  plain.execute("PRAGMA synchronous = OFF");  // It is made durable before it gets its name.
  Transaction transaction(plain);
  detail::Statement object = impl_->database.prepare(
      "SELECT type = 'table', name, sql FROM sqlite_schema WHERE sql IS NOT NULL "
      "ORDER BY type = 'table' DESC, rowid");
  while (object.step()) {
    plain.execute(detail::plain_definition(object.text(2)));
    if (object.integer(0) == 0) continue;
    plain.execute(
        fmt::format("INSERT INTO main.\"{0}\" SELECT * FROM source.\"{0}\"", object.text(1)));
  }
  transaction.commit();
}

void Store::back_up(const std::filesystem::path& destination,
                    const std::function<void()>& on_part) const {
  check_name(destination);
  const detail::StoreLock lock(destination, detail::IfNoLocks::go_on);
  detail::check_absence(destination);
  detail::appear_complete(destination, [&](const std::filesystem::path& draft) {
    detail::copy_whole(impl_->database, impl_->path, draft, on_part);
  });
}

}  // namespace proofmass::coordinator
