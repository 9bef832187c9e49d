#include "coordinator/report/digest.hpp"

#include <gtest/gtest.h>

#include "tests/support/microscope_results.hpp"

namespace proofmass::coordinator {
namespace {

// Digests of the documented bytes, made with Python's struct and hashlib.
constexpr const char* digest_of_nothing =
    "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
constexpr const char* digest_of_first =
    "1c67be44c7551128152e0805d20a1b8dfd788b49043e0db4763ad2a348fb1a01";
constexpr const char* digest_of_both =
    "d5f80df1d4e2a241fce93f8e659cbee48dd74c1d43ddd97d80854098cfedd596";
constexpr const char* health_of_first =
    "00e4d422c3e49483ec1334fd153b0c663b97d722ed65b8628b80958fdf708ae1";
constexpr const char* health_with_lost =
    "662fe94c7831e505adef1b9b28de61e22a86d931d155a97445bdb6716a4ea92c";

RunResult first_result() {
  RunResult result = test::zero_result(
      {.run = {7}, .status = RunStatus::not_converged, .num_draws = 3, .num_rounds = 5});
  for (std::size_t i = 0; i < num_parameters; ++i) {
    result.truth[i] = 0.5 + static_cast<double>(i);
    result.estimate[i] = -1.25 * static_cast<double>(i);  // The first one is a negative zero.
  }
  return result;
}

/// A result without a draw, with numbers that mean nothing.
RunResult second_result() {
  RunResult result = test::zero_result(
      {.run = {8}, .status = RunStatus::no_draw, .num_draws = 1000, .num_rounds = 0});
  result.truth.assign(num_parameters, 1.0);
  result.estimate.assign(num_parameters, 2.0);
  return result;
}

TEST(Digest, OfNothingIsThatOfNoBytes) {
  EXPECT_EQ(Digest().finish(), (ResultDigests{.results = digest_of_nothing, .health = ""}));
}

TEST(Digest, IsThatOfTheDocumentedBytes) {
  Digest digest;
  digest.add(first_result());
  EXPECT_EQ(digest.finish().results, digest_of_first);
}

TEST(Digest, LeavesOutWhatMeansNothing) {
  Digest digest;
  digest.add(first_result());
  digest.add(second_result());
  EXPECT_EQ(digest.finish(), (ResultDigests{.results = digest_of_both, .health = ""}));
}

TEST(Digest, OfHealthIsThatOfTheDocumentedBytesAndStandsAlone) {
  RunResult first = first_result();
  first.health = test::values_of({1e-7, 2e-5, -0.0, 0.25, 3e-4});
  first.loss.session = 9;  // Means nothing: the run is not lost.

  Digest digest;
  digest.add(first);
  digest.add(second_result());
  EXPECT_EQ(digest.finish(), (ResultDigests{.results = digest_of_both, .health = health_of_first}));

  RunResult lost = test::zero_result({.run = {9}, .status = RunStatus::lost});
  lost.health = test::values_of({1e-5, 2e-5, 1e-12, 0.25, 3e-4});
  lost.loss = test::loss_of(LossCause::saturation, SessionTarget::a_d11_prime);
  Digest with_lost;
  with_lost.add(first);
  with_lost.add(lost);
  EXPECT_EQ(with_lost.finish().health, health_with_lost);
}

}  // namespace
}  // namespace proofmass::coordinator
