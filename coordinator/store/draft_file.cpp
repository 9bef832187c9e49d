#include "coordinator/store/draft_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <system_error>
#include <utility>

namespace proofmass::coordinator {
namespace {

/// Makes a file, or the entries of a directory, durable.
int synchronise(const std::filesystem::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return errno;
  const int error_number = ::fsync(descriptor) == 0 ? 0 : errno;
  ::close(descriptor);
  return error_number;
}

// SQLite may have left a rollback journal beside an unfinished database.
void remove_draft(const std::filesystem::path& draft) {
  std::error_code ignored;
  std::filesystem::remove(draft, ignored);
  std::filesystem::remove(std::filesystem::path(draft).concat("-journal"), ignored);
}

// Not all file systems know how to keep what is there; the name was free a moment ago.
int rename_to(const std::filesystem::path& draft, const std::filesystem::path& path,
              IfThere if_there) {
  if (if_there == IfThere::keep) {
    if (::renameat2(AT_FDCWD, draft.c_str(), AT_FDCWD, path.c_str(), RENAME_NOREPLACE) == 0) {
      return 0;
    }
    if (errno != EINVAL && errno != ENOSYS) return errno;
  }
  return ::rename(draft.c_str(), path.c_str()) == 0 ? 0 : errno;
}

}  // namespace

DraftFile::DraftFile(std::filesystem::path path, std::string_view ending)
    : path_(std::move(path)), draft_(std::filesystem::path(path_).concat(ending)) {
  remove_draft(draft_);
}

DraftFile::~DraftFile() {
  if (!is_published_) remove_draft(draft_);
}

int DraftFile::publish(IfThere if_there) {
  const int error_number = publish_file(draft_, path_, if_there);
  is_published_ = error_number == 0;
  return error_number;
}

int publish_file(const std::filesystem::path& draft, const std::filesystem::path& path,
                 IfThere if_there) {
  const int error_number = synchronise(draft);
  return error_number == 0 ? rename_to(draft, path, if_there) : error_number;
}

std::filesystem::path directory_of(const std::filesystem::path& path) {
  std::error_code error;
  const std::filesystem::path absolute = std::filesystem::absolute(path, error);
  return (error ? path : absolute).parent_path();
}

int synchronise_directory_of(const std::filesystem::path& path) {
  return synchronise(directory_of(path));
}

}  // namespace proofmass::coordinator
