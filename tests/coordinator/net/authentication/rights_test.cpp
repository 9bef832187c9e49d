#include "coordinator/net/authentication/rights.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

std::string refusal_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "none";
}

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

TEST(RightsOfAKey, MustIncludeWhatIsAskedFor) {
  EXPECT_EQ(refusal_of([] { require_right(asker("anna", "submit"), Right::observe); }),
            "key = anna (must have the right `observe` in authorized_clients of the coordinator)");
  EXPECT_EQ(refusal_of([] { require_right(asker("anna", "control"), Right::submit); }),
            "key = anna (must have the right `submit` in authorized_clients of the coordinator)");
  EXPECT_EQ(refusal_of([] { require_right({}, Right::control); }), "none");
}

TEST(RightsOfAKey, ReachToItsOwnCampaignsAndThoseOfNobody) {
  const Asker anna = asker("anna", "observe,submit");
  EXPECT_EQ(refusal_of([&] { require_control(anna, "c", "anna"); }), "none");
  EXPECT_EQ(refusal_of([&] { require_control(anna, "c", ""); }), "none");
  EXPECT_EQ(refusal_of([&] { require_control(anna, "c", "ben"); }),
            "campaign = c (belongs to ben; the key anna must have the right `control`)");
  EXPECT_EQ(refusal_of([&] { require_control(asker("boss", "control"), "c", "ben"); }), "none");
  EXPECT_EQ(refusal_of([&] { require_control(asker("eve", "observe"), "c", ""); }),
            "key = eve (must have the right `submit` in authorized_clients of the coordinator)");
}

}  // namespace
}  // namespace proofmass::coordinator
