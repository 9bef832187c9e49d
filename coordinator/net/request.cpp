#include "coordinator/net/request.hpp"

#include <fmt/format.h>

#include <iterator>
#include <utility>

#include "core/campaign/model.hpp"
#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

Request read(wire::SubmitRequest&& sent) {
  return Submission{.campaign = model().campaign_of(std::move(sent.definition),
                                                    TableColumns::included, "definition"),
                    .priority = sent.priority,
                    .audit_fraction = sent.audit_fraction,
                    .stop_rule = std::move(sent.stop_rule),
                    .failures_max = sent.failures_max};
}

template <typename Other>
Request read(Other&& sent) {
  return std::forward<Other>(sent);
}

constexpr std::chrono::seconds silence_max(30);

}  // namespace

Request request_of(wire::ClientRequest sent) {
  return std::visit([](auto&& content) { return read(std::move(content)); }, std::move(sent));
}

RequestParts::Outcome RequestParts::take(const std::string& connection, std::uint64_t request,
                                         const wire::RequestPart& part, TimePoint now) {
  auto found = unfinished_.find(connection);
  const bool is_known = found != unfinished_.end() && found->second.request == request &&
                        found->second.total_size == part.total_size;
  if (!is_known) {
    if (part.offset != 0) return wire::PartReply{0};
    if (found != unfinished_.end()) drop(found);
    if (part.total_size > size_max_ - size_held_) {
      return wire::ErrorReply{
          fmt::format("request size = {} bytes (the coordinator is receiving {} bytes of others, "
                      "at most {} together: try again later)",
                      part.total_size, size_held_, size_max_)};
    }
    Unfinished begun{
        .request = request, .total_size = part.total_size, .bytes = {}, .heard_at = now};
    begun.bytes.reserve(begun.total_size);
    size_held_ += begun.total_size;
    found = unfinished_.emplace(connection, std::move(begun)).first;
  }
  Unfinished& unfinished = found->second;
  unfinished.heard_at = now;
  if (part.offset == unfinished.bytes.size()) unfinished.bytes += part.slice;
  if (unfinished.bytes.size() < unfinished.total_size) {
    return wire::PartReply{unfinished.bytes.size()};
  }
  Whole whole{.bytes = std::move(unfinished.bytes)};
  unfinished_.erase(found);
  return whole;
}

void RequestParts::release(std::size_t size) {
  PROOFMASS_EXPECT(size <= size_held_);
  size_held_ -= size;
}

void RequestParts::drop_stale(TimePoint now) {
  for (auto connection = unfinished_.begin(); connection != unfinished_.end();) {
    const bool is_stale = now - connection->second.heard_at > silence_max;
    connection = is_stale ? drop(connection) : std::next(connection);
  }
}

RequestParts::Connections::iterator RequestParts::drop(Connections::iterator connection) {
  size_held_ -= connection->second.total_size;
  return unfinished_.erase(connection);
}

}  // namespace proofmass::coordinator
