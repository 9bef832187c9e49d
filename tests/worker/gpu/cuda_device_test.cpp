#include "worker/gpu/cuda_device.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <functional>
#include <string>

#include "core/error.hpp"
#include "core/model.hpp"
#include "tests/support/cuda_driver/test_device.hpp"

namespace proofmass::worker {
namespace {

using testing::HasSubstr;

/// What a driver with a fault makes of an action.
std::string failure_with(const char* fault, const std::function<void()>& action) {
  test::load_driver();
  setenv("PROOFMASS_TEST_CUDA", fault, 1);
  std::string text;
  try {
    action();
  } catch (const std::exception& error) {
    text = error.what();
  }
  unsetenv("PROOFMASS_TEST_CUDA");
  return text;
}

TEST(Cards, AreChosenByTheirNumbers) {
  EXPECT_TRUE(cuda_cards_of("none").empty());
  std::vector<int> chosen;
  EXPECT_EQ(failure_with("two_cards",
                         [&] {
                           for (const CudaCard& card : cuda_cards_of("1,0"))
                             chosen.push_back(card.index);
                           for (const CudaCard& card : cuda_cards_of("all"))
                             chosen.push_back(card.index);
                         }),
            "");
  EXPECT_THAT(chosen, testing::ElementsAre(1, 0, 0, 1));
}

TEST(Cards, AreRefusedIfTheyAreNone) {
  for (const char* text : {"", "some", "0;1", "-1"}) {
    EXPECT_EQ(failure_with("", [&] { (void)cuda_cards_of(text); }),
              "gpu = " + std::string(text) + " (must be none, all, or numbers of cards as in 0,1)");
  }
  for (const char* text : {"2", "0,0", "0,", ",0", "99999999999999999999"}) {
    EXPECT_EQ(
        failure_with("two_cards", [&] { (void)cuda_cards_of(text); }),
        "gpu = " + std::string(text) + " (must be different numbers below 2, of the cards here)");
  }
  EXPECT_EQ(failure_with("no_card", [] { (void)cuda_cards_of("all"); }),
            "gpu = all (no NVIDIA card on this machine)");
}

TEST(CudaDevice, SaysWhatFails) {
  const auto prove = [] {
    CudaDevice device(cuda_cards_of("0").front(), std::chrono::milliseconds(0));
    (void)model().prove(device);
  };
  EXPECT_THAT(failure_with("no_memory", prove), HasSubstr("card 0: "));
  EXPECT_THAT(failure_with("no_memory", prove),
              HasSubstr(" bytes of memory: CUDA_ERROR_OF_THE_TEST (999)"));
  EXPECT_EQ(failure_with("broken_launch", prove), "card 0: launch: CUDA_ERROR_OF_THE_TEST (999)");
  EXPECT_EQ(failure_with("lost_device", prove), "card 0: kernels: CUDA_ERROR_OF_THE_TEST (999)");
  EXPECT_THAT(failure_with("hang", prove),
              HasSubstr("card 0: a kernel has not ended within 0 s (the card hangs: "));
  EXPECT_EQ(failure_with("", prove), "") << "a card that was reset";
}

}  // namespace
}  // namespace proofmass::worker
