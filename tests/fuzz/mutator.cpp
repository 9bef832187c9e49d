#include "tests/fuzz/mutator.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "tests/fuzz/fuzz_input.hpp"

namespace proofmass::test {

Mutator::Mutator(std::vector<std::string> inputs, std::uint64_t seed)
    : inputs_(std::move(inputs)), random_(seed) {}

std::string Mutator::next() {
  std::string bytes = below(2) == 0 ? mix_steps() : inputs_[below(inputs_.size())];
  const std::size_t num_changes = below(8);
  for (std::size_t i = 0; i < num_changes; ++i) change_byte(bytes);
  return bytes;
}

std::size_t Mutator::below(std::size_t bound) { return random_() % bound; }

/// Steps of one or two inputs, some left out, some twice, some out of order.
std::string Mutator::mix_steps() {
  std::vector<Step> steps = parse_steps(inputs_[below(inputs_.size())]);
  const std::vector<Step> others = parse_steps(inputs_[below(inputs_.size())]);
  const std::size_t num_changes = 1 + below(6);
  for (std::size_t i = 0; i < num_changes && !steps.empty(); ++i) {
    const auto at = steps.begin() + static_cast<std::ptrdiff_t>(below(steps.size()));
    switch (below(4)) {
      case 0:
        steps.erase(at);
        break;
      case 1:
        std::iter_swap(at, steps.begin() + static_cast<std::ptrdiff_t>(below(steps.size())));
        break;
      case 2:
        steps.push_back(*at);
        break;
      default:
        if (!others.empty()) steps.insert(at, others[below(others.size())]);
        break;
    }
  }
  return to_bytes(steps);
}

void Mutator::change_byte(std::string& bytes) {
  if (bytes.empty()) return;
  const std::size_t at = below(bytes.size());
  switch (below(5)) {
    case 0:
      bytes[at] = static_cast<char>(bytes[at] ^ 1 << below(8));
      break;
    case 1:
      bytes[at] = static_cast<char>(below(256));
      break;
    case 2:
      bytes.erase(at, 1 + below(4));
      break;
    case 3:
      bytes.insert(at, 1 + below(4), static_cast<char>(below(256)));
      break;
    default:
      bytes.resize(at);
      break;
  }
}

}  // namespace proofmass::test
