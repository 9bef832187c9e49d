#include "coordinator/store/detail/rescue.hpp"

#include <fmt/format.h>

#include <optional>
#include <string>

#include "coordinator/store/detail/file_system.hpp"
#include "coordinator/store/detail/result_rows.hpp"
#include "coordinator/store/detail/schema.hpp"
#include "coordinator/store/detail/store_impl.hpp"

namespace proofmass::coordinator::detail {
namespace {

[[noreturn]] void refuse(const Database& other, const std::string& what) {
  other.refuse(fmt::format(
      "took the place of the file that is being served, and {}; move it away, and the campaign is "
      "written to its place again",
      what));
}

std::optional<RunResult> next_result(Statement& row) {
  if (!row.step()) return std::nullopt;
  return read_result(row);
}

// Nothing that a worker was told to be safe may depend on the other file alone.
void check_that_results_are_here(const Database& other, const Database& open_file) {
  Statement theirs = select_results(other);
  Statement ours = select_results(open_file);
  std::optional<RunResult> own = next_result(ours);
  while (const std::optional<RunResult> result = next_result(theirs)) {
    while (own && own->run < result->run) own = next_result(ours);
    if (!own || own->run != result->run || !are_equal(*own, *result)) {
      refuse(other, fmt::format("has another result of run {}", result->run.value));
    }
  }
}

void check_that_it_is_an_older_copy(const std::filesystem::path& path, const Database& open_file) {
  Database other(path, Access::read_only);
  check_campaign_file(other, path);
  constexpr std::int64_t first_version_with_uid = 4;
  if (other.integer("PRAGMA user_version") < first_version_with_uid) {
    refuse(other, "is of a version of which that cannot be told to be the same campaign");
  }
  const std::string uid = "SELECT campaign_uid FROM campaign";
  if (other.integer(uid) != open_file.integer(uid)) refuse(other, "is of another campaign");
  const std::string num_runs = "SELECT num_runs FROM campaign";
  if (other.count(num_runs) > open_file.count(num_runs)) refuse(other, "has more runs");
  check_that_results_are_here(other, open_file);
}

void copy_to_draft(const Database& open_file, const std::filesystem::path& draft) {
  Database copy(draft, Access::create);
  open_file.copy_to(copy);
  // What is copied may say that there is a log.
  copy.execute("PRAGMA journal_mode = DELETE; UPDATE campaign SET is_log_needed = 0");
}

}  // namespace

void restore_name(const std::filesystem::path& path, Database& open_file, const FilePlace& place,
                  Placement placement) {
  check_directory_of(path);
  place.remove_own_log();
  const auto write = [&](const std::filesystem::path& draft) { copy_to_draft(open_file, draft); };
  if (placement == Placement::removed) {
    remove_log_of(path);  // Of nobody: no file has the name.
    appear_complete(path, IfThere::keep, write);
    return;
  }
  const FilePlace other(path);  // No other coordinator has it.
  check_that_it_is_an_older_copy(path, open_file);
  appear_complete(path, IfThere::replace, [&](const std::filesystem::path& draft) {
    write(draft);
    remove_log_of(path);  // That of the older copy, whose results are all here.
  });
}

}  // namespace proofmass::coordinator::detail
