#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

namespace proofmass::test {

/// Changes inputs at random, from a seed: whole steps and single bytes.
class Mutator {
 public:
  /// @param inputs  To begin from; at least one.
  Mutator(std::vector<std::string> inputs, std::uint64_t seed);

  /// The next input.
  [[nodiscard]] std::string next();

 private:
  [[nodiscard]] std::size_t below(std::size_t bound);
  [[nodiscard]] std::string mix_steps();
  void change_byte(std::string& bytes);

  std::vector<std::string> inputs_;
  std::mt19937_64 random_;
};

}  // namespace proofmass::test
