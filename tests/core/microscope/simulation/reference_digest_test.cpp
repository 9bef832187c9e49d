#include "core/microscope/simulation/reference_digest.hpp"

#include "tests/test.hpp"

namespace proofmass {
namespace {

TEST(ReferenceDigest, IsTheSameOnEveryInstructionSet) {
  const std::uint64_t reference = reference_digest(InstructionSet::scalar);
  for (const InstructionSet set : available_instruction_sets()) {
    EXPECT_EQ(reference_digest(set), reference) << name_of(set);
  }
}

}  // namespace
}  // namespace proofmass
