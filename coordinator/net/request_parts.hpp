#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <variant>

#include "coordinator/dispatch/state.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {

/// Requests that are too large for one message, while their parts come in and until they have been
/// read. A connection has one at a time: the first part of another takes the place of what was
/// there.
class RequestParts {
 public:
  /// All parts of a request are here.
  struct Whole {
    std::string bytes;
  };
  using Outcome = std::variant<wire::PartReply, Whole, wire::ErrorReply>;

  /// @param size_max  Of all requests together, bytes. Room for a request is taken with its first
  ///                  part.
  explicit RequestParts(std::size_t size_max = 2 * wire::submit_size_max) : size_max_(size_max) {}

  /// @param connection  Its routing id.
  [[nodiscard]] Outcome take(const std::string& connection, std::uint64_t request,
                             const wire::RequestPart& part, TimePoint now);

  /// The bytes of a whole request are held no more.
  void release(std::size_t size);

  /// Drops requests of which no part came for half a minute.
  void drop_stale(TimePoint now);

  [[nodiscard]] std::size_t size_held() const { return size_held_; }

 private:
  struct Unfinished {
    std::uint64_t request = 0;
    std::size_t total_size = 0;
    std::string bytes;
    TimePoint heard_at;
  };
  using Connections = std::map<std::string, Unfinished>;

  Connections::iterator drop(Connections::iterator connection);

  std::size_t size_max_;
  std::size_t size_held_ = 0;  ///< Counted by total_size; with whole ones until release().
  Connections unfinished_;
};

}  // namespace proofmass::coordinator
