#include "tests/fuzz/fuzz_input.hpp"

#include <algorithm>

namespace proofmass::test {
namespace {

constexpr std::size_t head_size = 4;

std::uint8_t byte_at(std::string_view input, std::size_t position) {
  return static_cast<std::uint8_t>(input[position]);
}

}  // namespace

bool has_content(StepKind kind) {
  return kind == StepKind::worker_message || kind == StepKind::client_request ||
         kind == StepKind::client_reply || kind == StepKind::coordinator_message;
}

std::vector<Step> parse_steps(std::string_view input) {
  std::vector<Step> steps;
  while (input.size() >= head_size) {
    Step step{.kind = static_cast<StepKind>(byte_at(input, 0) % num_step_kinds),
              .number = byte_at(input, 1),
              .value = static_cast<std::uint16_t>(byte_at(input, 2) | byte_at(input, 3) << 8),
              .content = {}};
    input.remove_prefix(head_size);
    if (has_content(step.kind)) {
      step.content = input.substr(0, step.value);
      input.remove_prefix(step.content.size());
    }
    steps.push_back(std::move(step));
  }
  return steps;
}

std::string to_bytes(const std::vector<Step>& steps) {
  std::string bytes;
  for (const Step& step : steps) {
    const std::size_t value = has_content(step.kind) ? step.content.size() : step.value;
    bytes += static_cast<char>(step.kind);
    bytes += static_cast<char>(step.number);
    bytes += static_cast<char>(value & 0xff);
    bytes += static_cast<char>(value >> 8);
    bytes += step.content;
  }
  return bytes;
}

FuzzSummary& FuzzSummary::operator+=(const FuzzSummary& other) {
  num_leases += other.num_leases;
  num_rejections += other.num_rejections;
  num_committed += other.num_committed;
  num_compared += other.num_compared;
  num_lost += other.num_lost;
  num_given_up += other.num_given_up;
  num_requests += other.num_requests;
  num_replies += other.num_replies;
  num_orders += other.num_orders;
  return *this;
}

}  // namespace proofmass::test
