#include "proto/link/whole_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string>

#include "core/error.hpp"

namespace proofmass::wire {
namespace {

bool write_all(int descriptor, std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(descriptor, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return false;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

/// A file beside the one to be written; it goes with the object unless it was renamed.
class DraftFile {
 public:
  explicit DraftFile(const std::filesystem::path& file)
      : path_(file.string() + ".XXXXXX"), descriptor_(::mkostemp(path_.data(), O_CLOEXEC)) {}
  ~DraftFile() {
    if (descriptor_ < 0) return;
    ::close(descriptor_);
    ::unlink(path_.c_str());
  }
  DraftFile(const DraftFile&) = delete;
  DraftFile& operator=(const DraftFile&) = delete;

  // Each returns false with the reason in errno.

  [[nodiscard]] bool write(std::string_view text, mode_t mode) const {
    return descriptor_ >= 0 && ::fchmod(descriptor_, mode) == 0 && write_all(descriptor_, text) &&
           ::fsync(descriptor_) == 0;
  }

  [[nodiscard]] bool appear_as(const std::filesystem::path& file, IfExists if_exists) const {
    if (if_exists == IfExists::replace) return ::rename(path_.c_str(), file.c_str()) == 0;
    return ::link(path_.c_str(), file.c_str()) == 0;  // Unlike rename(2) it replaces nothing.
  }

 private:
  std::string path_;
  int descriptor_;
};

bool synchronise(const std::filesystem::path& directory) {
  const int descriptor = ::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return false;
  const bool is_done = ::fsync(descriptor) == 0;
  ::close(descriptor);
  return is_done;
}

}  // namespace

void write_whole_file(std::string_view what, const std::filesystem::path& file,
                      std::string_view text, mode_t mode, IfExists if_exists) {
  const DraftFile draft(file);
  if (draft.write(text, mode) && draft.appear_as(file, if_exists) &&
      synchronise(std::filesystem::absolute(file).parent_path())) {
    return;
  }
  throw Error(fmt::format("{} = {} ({})", what, file.string(), std::strerror(errno)));
}

}  // namespace proofmass::wire
