#include "proto/wire/names.hpp"

#include <gtest/gtest.h>

namespace proofmass::wire {
namespace {

TEST(Name, IsOfLettersDigitsAndThreeSigns) {
  EXPECT_TRUE(is_name("host-1.example_A"));
  EXPECT_FALSE(is_name("two words"));
  for (const char* name : {"..", ".answers", "-rf", "--help", "_a", "/a"}) {
    EXPECT_FALSE(is_name(name)) << name;
  }
  EXPECT_FALSE(is_name("line\nbreak"));
  EXPECT_FALSE(is_name("é"));
}

TEST(Name, HasOneTo128Characters) {
  EXPECT_FALSE(is_name(""));
  EXPECT_TRUE(is_name(std::string(128, 'a')));
  EXPECT_FALSE(is_name(std::string(129, 'a')));
}

TEST(Name, IsMadeFromAnyText) {
  EXPECT_EQ(name_from("my host"), "my-host");
  EXPECT_EQ(name_from("-rf"), "xrf");
  EXPECT_EQ(name_from("éa"), "x-a");
  EXPECT_EQ(name_from(""), "unnamed");
  EXPECT_EQ(name_from(std::string(500, 'x')), std::string(128, 'x'));
}

}  // namespace
}  // namespace proofmass::wire
