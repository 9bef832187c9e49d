#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>

#include "core/campaign/campaign.hpp"
#include "proto/wire/client_messages.hpp"

namespace proofmass::coordinator {

/// A SubmitRequest whose definition has been read.
struct Submission {
  Campaign campaign;  ///< Valid, with its table columns.
  int priority = 0;
  double audit_fraction = 0.0;
  std::string stop_rule = {};
  std::optional<std::uint64_t> failures_max = {};
};

/// What a client asks for, ready to be carried out.
using Request = std::variant<Submission, wire::StatusRequest, wire::WorkersRequest,
                             wire::ControlRequest, wire::ReleaseHostRequest, wire::RequestPart>;

/// @throws DefinitionError if a submission's definition is not one.
[[nodiscard]] Request request_of(wire::ClientRequest sent);

}  // namespace proofmass::coordinator
