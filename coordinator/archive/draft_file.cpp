#include "coordinator/archive/draft_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>

#include "coordinator/archive/archive_error.hpp"

namespace proofmass::coordinator {
namespace {

// Makes a file, or a directory's entries, durable; returns an errno, 0 if all is well.
int synchronise(const std::filesystem::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return errno;
  const int error_number = ::fsync(descriptor) == 0 ? 0 : errno;
  ::close(descriptor);
  return error_number;
}

}  // namespace

DraftFile::DraftFile(std::filesystem::path path)
    : path_(std::move(path)),
      draft_(std::filesystem::path(path_).concat(fmt::format(".{}.new", ::getpid()))) {}

DraftFile::~DraftFile() {
  std::error_code ignored;
  if (!is_published_) std::filesystem::remove(draft_, ignored);
}

void DraftFile::publish() {
  if (const int error_number = synchronise(draft_)) fail_to_write(path_, error_number);
  if (std::rename(draft_.c_str(), path_.c_str()) != 0) fail_to_write(path_, errno);
  is_published_ = true;
  (void)synchronise(path_.has_parent_path() ? path_.parent_path() : ".");
}

void fail_to_write(const std::filesystem::path& path, int error_number) {
  throw ArchiveError(fmt::format("output = {} (cannot be written: {})", path.string(),
                                 std::strerror(error_number)));
}

}  // namespace proofmass::coordinator
