#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "proto/wire/messages.hpp"

namespace proofmass::test {

// An input of the fuzzer is a list of steps, each of them a head of four bytes and its content:
//
//     byte 0  what happens, by its remainder     byte 1  a number, such as that of a connection
//     bytes 2, 3  size of the content, or a number, the lower byte first
//
// The last content may be cut short by the end of the input.

enum class StepKind : std::uint8_t {
  worker_message = 0,       ///< Content arrives on connection `number`.
  client_request = 1,       ///< Content arrives from a client; a control request is carried out.
  client_reply = 2,         ///< Content arrives at a client.
  coordinator_message = 3,  ///< Content arrives at a worker, which is not played.
  commit = 4,               ///< Up to `number` + 1 results become durable.
  compare = 5,              ///< A result has been compared; it is equal if `number` is even.
  elapse = 6,               ///< `value` times 10 ms pass.
  store_failure = 7,        ///< Nothing can be stored; or it can again, if `number` is odd.
  gone = 8,                 ///< The process of the worker on connection `number` has ended.
};
inline constexpr std::uint8_t num_step_kinds = 9;

struct Step {
  StepKind kind = StepKind::worker_message;
  std::uint8_t number = 0;
  std::uint16_t value = 0;  ///< Where there is no content.
  std::string content;      ///< At most 65535 bytes.
};

[[nodiscard]] bool has_content(StepKind kind);

/// The steps in an input; any bytes are some list of steps.
[[nodiscard]] std::vector<Step> parse_steps(std::string_view input);

[[nodiscard]] std::string to_bytes(const std::vector<Step>& steps);

// What every input meets: a coordinator of this epoch with two campaigns, the second of which has
// table quantities.
inline constexpr wire::Epoch fuzz_epoch{7};
inline constexpr wire::CampaignId fuzz_campaign{101};
inline constexpr wire::CampaignId fuzz_table_campaign{102};
inline constexpr std::uint64_t fuzz_reference_digest = 5;
inline constexpr std::uint64_t fuzz_num_runs = 40;

/// What came of an input; shows that inputs reach more than the first check.
struct FuzzSummary {
  std::uint64_t num_leases = 0;      ///< Sent.
  std::uint64_t num_rejections = 0;  ///< Sent.
  std::uint64_t num_committed = 0;
  std::uint64_t num_compared = 0;
  std::uint64_t num_lost = 0;      ///< Runs.
  std::uint64_t num_given_up = 0;  ///< Runs.
  std::uint64_t num_requests = 0;  ///< Of clients, of the right form.
  std::uint64_t num_replies = 0;   ///< To clients, likewise.
  std::uint64_t num_orders = 0;    ///< Messages to workers, likewise.

  FuzzSummary& operator+=(const FuzzSummary& other);
};

/// Lets the steps of an input happen to decoders, workers' gateway and dispatch, which must survive
/// anything that peers send. Aborts if an invariant is broken, if a message that was sent cannot be
/// read, or if a run is handed to the store twice.
FuzzSummary run_fuzz_input(std::string_view input);

}  // namespace proofmass::test
