#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "proto/wire/messages.hpp"

namespace proofmass::coordinator {

/// How much a person should care; *error* means that somebody must act.
enum class Severity : std::uint8_t { info, warning, error };

/// Something that happened in a campaign: one line of the log.
struct Event {
  Severity severity = Severity::info;
  std::string_view kind;  ///< A literal: `lease_expired`.
  std::string text;       ///< `worker=7 runs=120..183 attempt=1`.
};

/// A result that a worker delivered, on its way to the store.
struct Arrival {
  wire::WorkerId worker;
  wire::Attempt attempt;  ///< Under which it was computed.
  wire::ComputedRun computed;
};

/// What the dispatch does to the world. The service carries it out; a test writes it down.
class Outbox {
 public:
  virtual ~Outbox() = default;

  /// May be lost, like anything that is sent; the dispatch copes.
  virtual void send(wire::WorkerId worker, wire::Message message) = 0;
  /// Must lead to on_committed() with this run once the result is durable, or to the end of the
  /// service. Called at most once for a run.
  virtual void store(Arrival arrival) = 0;
  virtual void log(Event event) = 0;
};

}  // namespace proofmass::coordinator
