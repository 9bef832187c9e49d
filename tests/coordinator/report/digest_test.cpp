#include "coordinator/report/digest.hpp"

#include <gtest/gtest.h>

namespace proofmass::coordinator {
namespace {

// Digests of the documented bytes, made with Python's struct and hashlib.
constexpr const char* digest_of_nothing =
    "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
constexpr const char* digest_of_first =
    "1c67be44c7551128152e0805d20a1b8dfd788b49043e0db4763ad2a348fb1a01";
constexpr const char* digest_of_both =
    "d5f80df1d4e2a241fce93f8e659cbee48dd74c1d43ddd97d80854098cfedd596";

RunResult first_result() {
  RunResult result{.run = {7}, .status = RunStatus::not_converged, .num_draws = 3, .num_rounds = 5};
  for (std::size_t i = 0; i < num_parameters; ++i) {
    result.truth[i] = 0.5 + static_cast<double>(i);
    result.estimate[i] = -1.25 * static_cast<double>(i);  // The first one is a negative zero.
  }
  return result;
}

/// A result without a draw, with numbers that mean nothing.
RunResult second_result() {
  RunResult result{.run = {8}, .status = RunStatus::no_draw, .num_draws = 1000, .num_rounds = 0};
  result.truth.fill(1.0);
  result.estimate.fill(2.0);
  return result;
}

TEST(Digest, OfNothingIsThatOfNoBytes) { EXPECT_EQ(Digest().finish(), digest_of_nothing); }

TEST(Digest, IsThatOfTheDocumentedBytes) {
  Digest digest;
  digest.add(first_result());
  EXPECT_EQ(digest.finish(), digest_of_first);
}

TEST(Digest, LeavesOutWhatMeansNothing) {
  Digest digest;
  digest.add(first_result());
  digest.add(second_result());
  EXPECT_EQ(digest.finish(), digest_of_both);
}

}  // namespace
}  // namespace proofmass::coordinator
