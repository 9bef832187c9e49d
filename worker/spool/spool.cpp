#include "worker/spool/spool.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>
#include <variant>

#include "core/campaign/name.hpp"
#include "core/error.hpp"
#include "core/math/hash.hpp"
#include "proto/link/whole_file.hpp"
#include "proto/wire/codec.hpp"

namespace proofmass::worker {
namespace {

constexpr std::string_view header_begin = "proofmass-spool 1 ";
constexpr std::size_t size_bytes = 4;
constexpr std::size_t checksum_bytes = 8;

std::string little_endian(std::uint64_t value, std::size_t num_bytes) {
  std::string bytes;
  for (std::size_t i = 0; i < num_bytes; ++i) bytes += static_cast<char>(value >> (8 * i));
  return bytes;
}

std::uint64_t from_little_endian(std::string_view bytes) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    value |= std::uint64_t{static_cast<unsigned char>(bytes[i])} << (8 * i);
  }
  return value;
}

std::string record_of(proto::ResultBatch batch) {
  proto::Envelope envelope;
  envelope.set_session(1);  // No message travels by it: the conversation makes the one that does.
  *envelope.mutable_result_batch() = std::move(batch);
  const std::string payload = wire::encode(std::move(envelope));
  return little_endian(payload.size(), size_bytes) + little_endian(fnv1a(payload), checksum_bytes) +
         payload;
}

/// The payload at the start of the bytes; nothing if they do not start with a whole record.
std::optional<std::string_view> payload_at(std::string_view bytes) {
  constexpr std::size_t head_bytes = size_bytes + checksum_bytes;
  if (bytes.size() < head_bytes) return std::nullopt;
  const std::uint64_t size = from_little_endian(bytes.substr(0, size_bytes));
  if (bytes.size() - head_bytes < size) return std::nullopt;
  const std::string_view payload = bytes.substr(head_bytes, size);
  const std::uint64_t expected = from_little_endian(bytes.substr(size_bytes, checksum_bytes));
  if (fnv1a(payload) != expected) return std::nullopt;
  return payload;
}

std::optional<proto::ResultBatch> batch_from(std::string_view payload) {
  auto decoded = wire::decode(payload);
  auto* const envelope = std::get_if<proto::Envelope>(&decoded);
  if (envelope == nullptr || !envelope->has_result_batch()) return std::nullopt;
  return std::move(*envelope->mutable_result_batch());
}

/// The model of a spool; empty of another file.
std::string_view model_in(std::string_view content) {
  if (!content.starts_with(header_begin)) return {};
  content.remove_prefix(header_begin.size());
  const std::string_view model = content.substr(0, content.find('\n'));
  return model.size() < content.size() && is_name(model) ? model : std::string_view();
}

}  // namespace

Spool::Spool(std::filesystem::path path, std::string_view model, std::uint64_t size_max)
    : path_(std::move(path)),
      header_(fmt::format("{}{}\n", header_begin, model)),
      size_max_(size_max) {
  open();
}

Spool::~Spool() {
  if (is_empty()) unlink(path_.c_str());
}

std::string Spool::message(std::string_view reason) const {
  return fmt::format("spool = {} ({})", path_.string(), reason);
}

void Spool::open() {
  file_ = wire::Descriptor(wire::open_own_file("spool", path_, wire::IfAbsent::make));
  const wire::Locked locked = wire::lock_file(file_.number());
  if (locked == wire::Locked::yes) return read();
  throw Error(message(locked == wire::Locked::by_another ? "used by another worker"
                                                         : wire::no_locks_remedy));
}

void Spool::read() {
  std::string content;
  std::array<char, 1 << 16> part{};
  ssize_t count = 0;
  while ((count = ::read(file_.number(), part.data(), part.size())) > 0) {
    content.append(part.data(), static_cast<std::size_t>(count));
    if (content.size() > size_max_) {
      throw Error(message(fmt::format("must be at most {} bytes", size_max_)));
    }
  }
  if (count < 0) throw Error(message(std::strerror(errno)));
  if (content.size() < header_.size() && header_.starts_with(content)) {
    num_bytes_dropped_ = content.size();
    if (const auto reason = write(header_)) throw Error(*reason);
  } else if (content.starts_with(header_)) {
    read_records(content);
  } else if (const std::string_view model = model_in(content); !model.empty()) {
    set_aside(model);
  } else {
    throw Error(message("must be a spool, or not exist"));
  }
}

// Its results are of use to a coordinator of that model only.
void Spool::set_aside(std::string_view model) {
  former_spool_ = fmt::format("{}.{}", path_.string(), model);
  const int error_number = wire::publish_file(path_, former_spool_, wire::IfThere::keep);
  if (error_number != 0) {
    throw Error(message(fmt::format("of the model {}; cannot become {}: {}", model,
                                    former_spool_.string(), std::strerror(error_number))));
  }
  open();
}

void Spool::read_records(std::string_view content) {
  size_ = header_.size();
  while (const auto payload = payload_at(content.substr(size_))) {
    const auto batch = batch_from(*payload);
    if (!batch) break;
    for (const proto::ComputedRun& run : batch->results()) {
      former_results_.push_back({{batch->campaign()}, {batch->attempt()}, wire::computed_run(run)});
      spooled_.emplace(wire::CampaignId{batch->campaign()}, RunIndex{run.run()});
    }
    size_ += size_bytes + checksum_bytes + payload->size();
  }
  num_bytes_dropped_ = content.size() - size_;
  if (num_bytes_dropped_ == 0) return;
  if (ftruncate(file_.number(), static_cast<off_t>(size_)) != 0)
    throw Error(message(std::strerror(errno)));
}

std::optional<std::string> Spool::write(std::string_view bytes) {
  if (size_ + bytes.size() > size_max_) {
    return message(fmt::format("full: must be at most {} bytes", size_max_));
  }
  const auto end = static_cast<off_t>(size_);
  if (lseek(file_.number(), end, SEEK_SET) != end || !wire::write_all(file_.number(), bytes) ||
      fdatasync(file_.number()) != 0) {
    std::string reason = message(std::strerror(errno));
    [[maybe_unused]] const int cut = ftruncate(file_.number(), end);
    return reason;
  }
  size_ += bytes.size();
  return std::nullopt;
}

void Spool::clear() {
  if (is_empty()) return;
  // If it cannot be cut, its results are delivered once more, which changes nothing.
  if (ftruncate(file_.number(), static_cast<off_t>(header_.size())) == 0) size_ = header_.size();
}

std::optional<std::string> Spool::look(const std::vector<wire::LeasedResult>& unacknowledged) {
  if (unacknowledged.empty()) {
    clear();
    spooled_.clear();
    seen_.clear();
    return std::nullopt;
  }
  std::set<RunKey> old;
  std::set<RunKey> seen;
  wire::ResultBatches batches;
  for (const wire::LeasedResult& result : unacknowledged) {
    const RunKey key{result.campaign, result.computed.result.run};
    seen.insert(key);
    if (!seen_.contains(key) || spooled_.contains(key)) continue;
    old.insert(key);
    batches.add(result);
  }
  seen_ = std::move(seen);
  if (old.empty()) return std::nullopt;
  std::string records;
  for (proto::ResultBatch& batch : batches.take()) records += record_of(std::move(batch));
  if (auto reason = write(records)) return reason;
  spooled_.merge(old);
  return std::nullopt;
}

std::optional<std::string> Spool::finish(const std::vector<wire::LeasedResult>& unacknowledged) {
  (void)look(unacknowledged);
  return look(unacknowledged);
}

std::size_t Spool::num_missing(const std::vector<wire::LeasedResult>& unacknowledged) const {
  return static_cast<std::size_t>(std::ranges::count_if(unacknowledged, [&](const auto& result) {
    return !spooled_.contains({result.campaign, result.computed.result.run});
  }));
}

}  // namespace proofmass::worker
