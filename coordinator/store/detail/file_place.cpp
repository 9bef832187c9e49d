#include "coordinator/store/detail/file_place.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sqlite3.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

#include "coordinator/store/detail/file_system.hpp"
#include "coordinator/store/detail/result_rows.hpp"
#include "coordinator/store/detail/schema.hpp"
#include "coordinator/store/detail/store_impl.hpp"
#include "coordinator/store/store_error.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator::detail {
namespace {

// SQLite's file format, section 4.1: a log begins with this number, whose last bit is the byte
// order of its checksums; 32 bytes are followed by frames of a header of 24 bytes and a page.
constexpr std::uint32_t log_magic = 0x377f0682;
constexpr std::size_t log_header_size = 32;
constexpr std::size_t frame_header_size = 24;

// By its canonical name, so that a directory that the process leaves changes nothing.
std::filesystem::path canonical_path(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::path result = std::filesystem::weakly_canonical(path, error);
  return error ? path : result;
}

// Of a canonical name, as SQLite has opened it: whatever a symbolic link that took the name since
// leads to has other files beside it.
std::filesystem::path log_of(const std::filesystem::path& canonical) {
  return std::filesystem::path(canonical).concat("-wal");
}

std::filesystem::path index_of(const std::filesystem::path& canonical) {
  return std::filesystem::path(canonical).concat("-shm");
}

void remove_file(const std::filesystem::path& path) {
  if (::unlink(path.c_str()) == 0 || errno == ENOENT) return;
  throw StoreError(
      fmt::format("file = {} (cannot be removed: {})", path.string(), std::strerror(errno)));
}

int open_and_lock(const std::filesystem::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDWR | O_CLOEXEC);
  if (descriptor < 0) {
    const int error = errno;
    throw StoreError(fmt::format("campaign database = {} ({})", path.string(),
                                 error == EACCES || error == EROFS
                                     ? std::string("is not writable")
                                     : fmt::format("cannot be opened: {}", std::strerror(error))));
  }
  const wire::Locked locked = wire::lock_file(descriptor);
  if (locked == wire::Locked::yes) return descriptor;
  ::close(descriptor);
  throw StoreError(
      fmt::format("campaign database = {} ({})", path.string(),
                  locked == wire::Locked::impossible
                      ? wire::no_locks_remedy
                      : "another coordinator has it; a campaign has one coordinator at a time"));
}

[[noreturn]] void refuse_to_make(const std::filesystem::path& file, std::string_view kind,
                                 const std::filesystem::path& beside) {
  throw StoreError(
      fmt::format("campaign database = {0} (is gone, but its {1} {2} is there: put the file back, "
                  "or move {2} away and begin anew)",
                  file.string(), kind, beside.filename().string()));
}

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

void check_that_it_is_an_older_copy(const std::filesystem::path& path, Access access,
                                    const Database& open_file) {
  Database other(path, access);
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

std::filesystem::path log_path(const std::filesystem::path& file) {
  return log_of(canonical_path(file));
}

std::filesystem::path journal_path(const std::filesystem::path& file) {
  return canonical_path(file).concat("-journal");
}

bool has_log(const std::filesystem::path& file) {
  std::ifstream stream(log_path(file), std::ios::binary);
  std::array<unsigned char, log_header_size + frame_header_size + 1> bytes{};
  stream.read(reinterpret_cast<char*>(bytes.data()), bytes.size());
  if (!stream) return false;
  std::uint32_t magic = 0;
  for (std::size_t i = 0; i < sizeof magic; ++i) magic = magic << 8 | bytes[i];
  return (magic & ~std::uint32_t{1}) == log_magic;
}

// Without a Database: that would ask this function what to say of an error.
bool is_sound_without_log(const std::filesystem::path& file) {
  sqlite3* opened = nullptr;
  const int code = sqlite3_open_v2(file_uri(file, "immutable=1").c_str(), &opened,
                                   SQLITE_OPEN_READONLY | SQLITE_OPEN_URI, nullptr);
  const std::unique_ptr<sqlite3, int (*)(sqlite3*)> connection(opened, &sqlite3_close_v2);
  if (code != SQLITE_OK) return false;
  bool is_sound = false;
  const auto take = [](void* result, int, char** texts, char**) {
    *static_cast<bool*>(result) = texts[0] != nullptr && std::string_view(texts[0]) == "ok";
    return 0;
  };
  const int end = sqlite3_exec(opened, "PRAGMA trusted_schema = OFF; PRAGMA quick_check(1)", take,
                               &is_sound, nullptr);
  return end == SQLITE_OK && is_sound;
}

void check_absence(const std::filesystem::path& file) {
  std::error_code ignored;
  if (std::filesystem::exists(file, ignored)) {
    throw StoreError(fmt::format("campaign database = {} (exists already)", file.string()));
  }
  if (has_log(file)) refuse_to_make(file, "log", log_path(file));
  const std::uintmax_t journal_size = std::filesystem::file_size(journal_path(file), ignored);
  if (!ignored && journal_size > 0) refuse_to_make(file, "journal", journal_path(file));
}

FilePlace::FilePlace(const std::filesystem::path& file)
    : path_(canonical_path(file)), descriptor_(open_and_lock(path_)), file_(identity_at(path_)) {}

FilePlace::~FilePlace() { ::close(descriptor_); }

FilePlace::Identity FilePlace::identity_at(const std::filesystem::path& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return {};
  return {.device = status.st_dev, .number = status.st_ino};
}

void FilePlace::remember_log() {
  log_ = identity_at(log_of(path_));
  index_ = identity_at(index_of(path_));
}

Placement FilePlace::look() {
  struct stat status {};
  if (::fstat(descriptor_, &status) == 0) {
    is_truncated_ = is_truncated_ || status.st_size < size_max_;
    size_max_ = std::max(size_max_, status.st_size);
  }
  if (is_truncated_) return Placement::truncated;
  const Identity present = identity_at(path_);
  if (present == file_) {
    return identity_at(log_of(path_)) == log_ ? Placement::in_place : Placement::log_removed;
  }
  if (present != Identity{}) return Placement::replaced;
  std::error_code ignored;
  return std::filesystem::is_directory(path_.parent_path(), ignored) ? Placement::removed
                                                                     : Placement::without_directory;
}

bool FilePlace::has_own_log() const {
  return log_ != Identity{} && identity_at(log_of(path_)) == log_;
}

void FilePlace::remove_own_log() const {
  if (has_own_log()) remove_file(log_of(path_));
  if (index_ != Identity{} && identity_at(index_of(path_)) == index_) {
    remove_file(index_of(path_));
  }
}

void remove_log_of(const std::filesystem::path& file) {
  remove_file(log_of(file));
  remove_file(index_of(file));
}

void restore_name(const std::filesystem::path& path, Database& open_file, const FilePlace& place,
                  Placement placement, OwnLog own_log) {
  check_directory_of(path);
  // While results are in the log only, it stays until a complete copy is there.
  if (own_log == OwnLog::folded_in || !place.has_own_log()) place.remove_own_log();
  const auto write = [&](const std::filesystem::path& draft) { copy_to_draft(open_file, draft); };
  if (placement == Placement::removed) {
    appear_complete(path, wire::IfThere::keep, [&](const std::filesystem::path& draft) {
      write(draft);
      remove_log_of(path);  // Ours, all of which is in the copy, or of a file that is gone.
    });
    return;
  }
  const FilePlace other(path);  // No other coordinator has it.
  // While our log is there, the other file has none, and ours must not be applied to it.
  const Access access = place.has_own_log() ? Access::immutable : Access::read_only;
  check_that_it_is_an_older_copy(path, access, open_file);
  appear_complete(path, wire::IfThere::replace, [&](const std::filesystem::path& draft) {
    write(draft);
    remove_log_of(path);  // Ours, or that of the older copy, whose results are all here.
  });
}

}  // namespace proofmass::coordinator::detail
