#include "coordinator/query/part_stream.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>

#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::size_t buffer_size = std::size_t{64} << 10;
constexpr std::chrono::milliseconds delay_max(20);

/// What comes before the text of a part, of this machine's layout: both ends are one program.
struct Head {
  std::uint32_t kind = 0;
  std::uint32_t size = 0;
};

}  // namespace

PartWriter::PartWriter(int pipe) : pipe_(pipe), thread_([this] { write_late(); }) {}

PartWriter::~PartWriter() {
  {
    const std::lock_guard lock(mutex_);
    is_ending_ = true;
  }
  changed_.notify_one();
  thread_.join();
  write_all();
}

void PartWriter::add(PartKind kind, std::string_view text) {
  if (text.size() > part_size_max) {
    throw Error(fmt::format("row = {} bytes (must be at most {})", text.size(), part_size_max));
  }
  const Head head{.kind = static_cast<std::uint32_t>(kind),
                  .size = static_cast<std::uint32_t>(text.size())};
  std::array<char, sizeof head> bytes{};
  std::memcpy(bytes.data(), &head, sizeof head);
  const std::lock_guard lock(mutex_);
  const bool is_first = buffer_.empty();
  buffer_.append(bytes.data(), bytes.size()).append(text);
  if (buffer_.size() >= buffer_size) {
    write_all();
  } else if (is_first) {
    changed_.notify_one();
  }
}

void PartWriter::write_late() {
  std::unique_lock lock(mutex_);
  while (!is_ending_) {
    changed_.wait(lock, [&] { return is_ending_ || !buffer_.empty(); });
    changed_.wait_for(lock, delay_max, [&] { return is_ending_; });
    write_all();
  }
}

// A parent that is gone has taken this process with it.
void PartWriter::write_all() {
  std::string_view left = buffer_;
  while (!left.empty()) {
    const ssize_t size = write(pipe_, left.data(), left.size());
    if (size < 0 && errno != EINTR) break;
    if (size > 0) left.remove_prefix(static_cast<std::size_t>(size));
  }
  buffer_.clear();
}

void PartReader::read(std::string_view bytes, const Visit& visit) {
  buffer_ += bytes;
  std::string_view left = buffer_;
  Head head;
  while (left.size() >= sizeof head) {
    std::memcpy(&head, left.data(), sizeof head);
    const bool is_known = head.kind >= static_cast<std::uint32_t>(PartKind::rows) &&
                          head.kind <= static_cast<std::uint32_t>(PartKind::other_error);
    if (!is_known || head.size > part_size_max) {
      throw Error("query: its process does not keep to the format of its answer");
    }
    if (left.size() - sizeof head < head.size) break;
    visit(static_cast<PartKind>(head.kind), left.substr(sizeof head, head.size));
    left.remove_prefix(sizeof head + head.size);
  }
  buffer_.erase(0, buffer_.size() - left.size());
}

}  // namespace proofmass::coordinator
