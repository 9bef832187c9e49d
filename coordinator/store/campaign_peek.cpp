#include "coordinator/store/campaign_peek.hpp"

#include <system_error>

#include "coordinator/store/detail/campaign_rows.hpp"
#include "coordinator/store/detail/database.hpp"
#include "coordinator/store/detail/file_place.hpp"
#include "coordinator/store/detail/schema.hpp"

namespace proofmass::coordinator {
namespace {

using detail::Database;

/// Whether the campaign has ended, and its statistics are those of all of its results.
bool is_complete(const Database& database, CampaignPeek& peek) {
  peek.num_given_up = database.count("SELECT count(*) FROM run_failure");
  peek.num_finished = database.count("SELECT coalesce(max(num_finished), 0) FROM summary");
  if (peek.phase == wire::CampaignPhase::finished) {
    return peek.num_finished + peek.num_given_up == peek.num_runs;
  }
  return peek.phase == wire::CampaignPhase::cancelled &&
         database.count("SELECT count(*) FROM delivery") == peek.num_finished;
}

}  // namespace

bool has_journal(const std::filesystem::path& path) {
  for (const std::filesystem::path& log : {detail::log_path(path), detail::journal_path(path)}) {
    std::error_code error;
    const std::uintmax_t size = std::filesystem::file_size(log, error);
    if (!error && size > 0) return true;
  }
  return false;
}

CampaignPeek peek_campaign(const std::filesystem::path& path, PeekDepth depth) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored)) detail::refuse_file(path, "is no file");
  Database database(path, detail::Access::immutable);
  database.execute("PRAGMA trusted_schema = OFF; PRAGMA cell_size_check = ON");
  if (depth == PeekDepth::pages) {
    detail::check_campaign_file(database);
    (void)detail::check_all_pages(database);
  } else {
    detail::check_kind(database);
  }
  const CampaignControl control = detail::read_control(database);
  CampaignPeek peek{.id = {database.count("SELECT campaign_uid FROM campaign")},
                    .name = database.text("SELECT name FROM campaign"),
                    .created_utc = database.text("SELECT created_utc FROM campaign"),
                    .num_runs = database.count("SELECT num_runs FROM campaign"),
                    .owner = database.text("SELECT owner FROM campaign")};
  peek.phase = control.phase;
  peek.priority = control.priority;
  const bool is_log_needed = database.integer("SELECT is_log_needed FROM campaign") != 0;
  peek.is_at_rest = is_complete(database, peek) && !is_log_needed && !has_journal(path);
  return peek;
}

}  // namespace proofmass::coordinator
