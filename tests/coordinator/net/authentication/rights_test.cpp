#include "coordinator/net/authentication/rights.hpp"

#include <gtest/gtest.h>

#include <string>

#include "core/error.hpp"
#include "tests/proto/link/scratch_directory.hpp"

namespace proofmass::coordinator {
namespace {

Asker asker(const std::string& name, const std::string& rights) {
  return {.name = name, .rights = Rights::parse(rights).value()};
}

TEST(RightsOfAKey, AreAListOfWords) {
  EXPECT_EQ(Rights::parse("observe,submit,control"), Rights::all());
  EXPECT_EQ(Rights::parse("submit,observe"), Rights::usual());
  EXPECT_FALSE(Rights::parse("observe")->has(Right::submit));
  for (const std::string text : {"", "observe,", ",", "Observe", "observe, submit", "root"}) {
    EXPECT_EQ(Rights::parse(text), std::nullopt) << text;
  }
}

TEST(RightsOfAKey, ReachToItsOwnCampaignsAndThoseOfNobody) {
  const Asker anna = asker("anna", "observe,submit");
  EXPECT_EQ(test::refusal_of([&] { require_control(anna, "c", "anna"); }), "accepted");
  EXPECT_EQ(test::refusal_of([&] { require_control(anna, "c", ""); }), "accepted");
  EXPECT_EQ(test::refusal_of([&] { require_control(anna, "c", "ben"); }),
            "campaign = c (belongs to ben; the key anna must have the right `control`)");
  EXPECT_EQ(test::refusal_of([&] { require_control(asker("boss", "control"), "c", "ben"); }),
            "accepted");
  EXPECT_EQ(test::refusal_of([&] { require_control(asker("eve", "observe"), "c", ""); }),
            "key = eve (must have the right `submit` in authorized_clients of the coordinator)");
}

}  // namespace
}  // namespace proofmass::coordinator
