#include "coordinator/store/detail/file_place.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sqlite3.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>

#include "coordinator/store/detail/database.hpp"
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
      fmt::format("campaign database = {0} (is gone, but its {1} {2} is there: {3}, or move {2} "
                  "away and begin anew)",
                  file.string(), kind, beside.filename().string(),
                  kind == "copy" ? "give it the name" : "put the file back"));
}

// A copy that Store::check_place() made of a file with this name; empty if there is none.
std::filesystem::path recovered_copy_of(const std::filesystem::path& file) {
  const std::string beginning = file.stem().string() + ".recovered-";
  std::error_code error;
  std::filesystem::directory_iterator item(wire::directory_of(file), error);
  for (; !error && item != std::filesystem::directory_iterator(); item.increment(error)) {
    const bool is_copy = item->path().filename().string().starts_with(beginning);
    if (is_copy && item->path().extension() == file.extension()) return item->path();
  }
  return {};
}

constexpr std::string_view truncated =
    "was truncated or written over while it was served: what it held is lost; stop the "
    "coordinator, put a copy back, and what the copy lacks is computed again";

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
  const std::filesystem::path copy = recovered_copy_of(file);
  if (!copy.empty()) refuse_to_make(file, "copy", copy);
}

FilePlace::FilePlace(const std::filesystem::path& file)
    : path_(canonical_path(file)), descriptor_(open_and_lock(path_)), file_(identity_at(path_)) {}

FilePlace::~FilePlace() { ::close(descriptor_); }

FilePlace::Identity FilePlace::identity_at(const std::filesystem::path& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) == 0) return {status.st_dev, status.st_ino};
  if (errno == ENOENT || errno == ENOTDIR) return {};
  throw StoreError(fmt::format("campaign database = {} (cannot be reached: {})", path.string(),
                               std::strerror(errno)));
}

void FilePlace::remember_log() {
  log_ = identity_at(log_of(path_));
  index_ = identity_at(index_of(path_));
}

std::string_view FilePlace::look() {
  if (is_lost()) return loss_;
  struct stat status {};
  if (::fstat(descriptor_, &status) == 0) {
    if (status.st_size < size_max_) return loss_ = truncated;
    size_max_ = status.st_size;
  }
  const Identity present = identity_at(path_);
  if (present == Identity{}) {
    loss_ = "was removed or renamed while it was served";
  } else if (present != file_) {
    loss_ = "was replaced by another file while it was served";
  } else if (identity_at(log_of(path_)) != log_) {
    loss_ = "lost its write-ahead log, which was removed while it was served";
  }
  return loss_;
}

bool FilePlace::is_truncated() const { return loss_ == truncated; }

void FilePlace::remove_own_log() const {
  const auto remove = [](const std::filesystem::path& path, const Identity& own) {
    if (own != Identity{} && identity_at(path) == own) ::unlink(path.c_str());
  };
  remove(log_of(path_), log_);
  remove(index_of(path_), index_);
}

}  // namespace proofmass::coordinator::detail
