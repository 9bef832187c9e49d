#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <type_traits>
#include <variant>

#include "core/campaign/campaign.hpp"
#include "proto/wire/client_messages.hpp"

namespace proofmass::coordinator {

/// A SubmitRequest whose definition has been read.
struct Submission {
  /// Valid, with its table columns; shared with the work that stores it.
  std::shared_ptr<const Campaign> campaign;
  int priority = 0;
  double audit_fraction = 0.0;
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

}  // namespace proofmass::coordinator
