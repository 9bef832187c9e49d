#include "coordinator/store/campaign_record.hpp"

#include <sys/stat.h>

#include <system_error>

#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/file_place.hpp"
#include "coordinator/store/detail/rows.hpp"
#include "coordinator/store/detail/schema.hpp"
#include "coordinator/store/detail/store_impl.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

using detail::Database;

CampaignRecord read_record(const Database& database) {
  const CampaignControl control = detail::read_control(database);
  const detail::Statement row = database.first_row(
      "SELECT campaign_uid, created_utc, name, num_runs, model_version, owner FROM campaign");
  CampaignRecord record{
      .id = {row.count(0)}, .seed = detail::read_seed(database), .created_utc = row.text(1)};
  record.status.set_name(row.text(2));
  record.status.set_phase(wire::message_value(control.phase));
  record.status.set_priority(control.priority);
  record.status.set_num_runs(row.count(3));
  record.status.set_model_version(wire::name_from(row.text(4)));
  record.status.set_owner(row.text(5));
  return record;
}

/// Whether the campaign has ended, and its statistics are those of all of its results.
bool is_complete(const Database& database, const proto::CampaignStatus& status) {
  if (status.phase() == proto::CAMPAIGN_PHASE_FINISHED) {
    return status.num_done() + status.num_given_up() == status.num_runs();
  }
  return status.phase() == proto::CAMPAIGN_PHASE_CANCELLED &&
         database.count("SELECT count(*) FROM delivery") == status.num_done();
}

/// The limit that cancelled the campaign, if one did.
std::optional<std::uint64_t> failures_exceeded(const Database& database,
                                               const proto::CampaignStatus& status) {
  if (status.phase() != proto::CAMPAIGN_PHASE_CANCELLED) return std::nullopt;
  return database
      .first_row(
          "SELECT CASE WHEN failures_max < (SELECT count(*) FROM run_failure) +"
          " (SELECT count(*) FROM run_result WHERE status <> 1) THEN failures_max END"
          " FROM campaign")
      .optional_count(0);
}

}  // namespace

std::optional<FileStamp> stamp_of(const std::filesystem::path& file) {
  struct stat status {};
  if (::stat(file.c_str(), &status) != 0) return std::nullopt;
  constexpr std::int64_t ns_per_s = 1'000'000'000;
  return FileStamp{.inode = status.st_ino,
                   .size = status.st_size,
                   .written_ns = status.st_mtim.tv_sec * ns_per_s + status.st_mtim.tv_nsec};
}

bool has_journal(const std::filesystem::path& path) {
  for (const std::filesystem::path& log : {detail::log_path(path), detail::journal_path(path)}) {
    std::error_code error;
    const std::uintmax_t size = std::filesystem::file_size(log, error);
    if (!error && size > 0) return true;
  }
  return false;
}

CampaignRecord Store::record() const { return read_record(impl_->database); }

CampaignRecord peek_campaign(const std::filesystem::path& path, PeekDepth depth) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) detail::refuse_file(path, "is no file");
  Database database(path, detail::Access::immutable);
  database.execute("PRAGMA trusted_schema = OFF; PRAGMA cell_size_check = ON");
  const detail::StoredKind kind = depth == PeekDepth::pages ? detail::check_campaign_file(database)
                                                            : detail::check_kind(database);
  if (depth == PeekDepth::pages) (void)detail::check_all_pages(database);
  CampaignRecord record = read_record(database);
  record.file = path;
  proto::CampaignStatus& status = record.status;
  status.set_num_given_up(database.count("SELECT count(*) FROM run_failure"));
  status.set_num_done(database.count("SELECT coalesce(max(num_finished), 0) FROM summary"));
  status.set_num_without_estimate(database.count(
      "SELECT coalesce(max(num_not_converged + num_not_finite + num_no_draw + num_lost), 0)"
      " FROM summary"));
  status.set_num_mismatches(database.count("SELECT count(*) FROM audit WHERE NOT is_equal"));
  // To count those that agree takes reading them, which is worth it beside one that does not.
  if (status.num_mismatches() > 0) {
    status.set_num_audited(database.count("SELECT count(*) FROM audit"));
  }
  if (const auto failures_max = failures_exceeded(database, status)) {
    status.set_failures_max(*failures_max);
  }
  const bool is_log_needed = database.integer("SELECT is_log_needed FROM campaign") != 0;
  const bool can_go_on =
      kind.model->can_simulate() || kind.model->reference_digest(best_instruction_set()) != 0;
  if (!can_go_on && status.phase() == proto::CAMPAIGN_PHASE_ACTIVE) {
    status.set_phase(proto::CAMPAIGN_PHASE_PAUSED);
  }
  record.is_closed =
      (!can_go_on || is_complete(database, status)) && !is_log_needed && !has_journal(path);
  return record;
}

}  // namespace proofmass::coordinator
