#include "coordinator/net/background.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <future>

namespace proofmass::coordinator {
namespace {

TEST(Background, TakesNoMoreThanMayWait) {
  std::promise<void> gate;
  Background background([] {});
  const auto wait = [opened = gate.get_future().share()]() -> Background::Finish {
    opened.wait();
    return [] {};
  };
  for (std::size_t i = 0; i < Background::num_pending_max; ++i) EXPECT_TRUE(background.post(wait));
  EXPECT_FALSE(background.post(wait));
  gate.set_value();
}

}  // namespace
}  // namespace proofmass::coordinator
