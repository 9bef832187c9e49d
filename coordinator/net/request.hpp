#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <type_traits>
#include <variant>

#include "coordinator/dispatch/state.hpp"
#include "core/campaign/campaign.hpp"
#include "proto/wire/client_codec.hpp"
#include "proto/wire/client_messages.hpp"

namespace proofmass::coordinator {

/// A SubmitRequest whose definition has been read.
struct Submission {
  /// Valid, with its table columns; shared with the work that stores it.
  std::shared_ptr<const Campaign> campaign;
  std::optional<int> priority = {};
  std::optional<double> audit_fraction = {};
  std::string stop_rule = {};
  std::optional<std::uint64_t> failures_max = {};
};

namespace detail {

template <typename Sent>
struct ReadyToCarryOut;
template <typename... Sent>
struct ReadyToCarryOut<std::variant<Sent...>> {
  using type = std::variant<
      std::conditional_t<std::is_same_v<Sent, wire::SubmitRequest>, Submission, Sent>...>;
};

}  // namespace detail

/// What a client asks for, ready to be carried out: a Submission in place of the SubmitRequest.
using Request = detail::ReadyToCarryOut<wire::ClientRequest>::type;

/// @throws DefinitionError if a submission's definition is not one.
[[nodiscard]] Request request_of(wire::ClientRequest sent);

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
