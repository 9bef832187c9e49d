#include "coordinator/page/page_access.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

TEST(PageTarget, IsTakenApart) {
  const auto request = parse_target("/campaigns/a%20b?events=2&fragment&filter=x+y%26z");
  ASSERT_TRUE(request.has_value());
  EXPECT_THAT(request->path, ElementsAre("campaigns", "a b"));
  EXPECT_EQ(request->number("events"), 2U);
  EXPECT_TRUE(request->has("fragment"));
  EXPECT_EQ(request->text("filter"), "x y&z");
  EXPECT_FALSE(request->has("sort"));
  EXPECT_EQ(request->text("sort"), "");
}

TEST(PageTarget, MayBeTheRootAlone) {
  EXPECT_TRUE(parse_target("/")->path.empty());
  EXPECT_TRUE(parse_target("/?token=x")->path.empty());
}

TEST(PageTarget, LeadsNowhereElse) {
  for (const std::string target : {"", "campaigns", "*", "http://other.example/", "/..", "/a/../b",
                                   "/.", "/%2e%2e/passwd", "/%2E%2e", "/a%2fb", "/a%00b", "//a",
                                   "/a//b", "/a/", "/%", "/%1", "/%zz", "/%-1", "/% 1"}) {
    EXPECT_FALSE(parse_target(target).has_value()) << target;
  }
}

TEST(PageTarget, HasABoundedNumberOfParameters) {
  std::string target = "/?a0";
  for (int i = 1; i < 16; ++i) target += "&a" + std::to_string(i);
  EXPECT_TRUE(parse_target(target).has_value());
  EXPECT_FALSE(parse_target(target + "&b").has_value());
  EXPECT_FALSE(parse_target("/?a=%").has_value());
}

TEST(PageTarget, HasNumbersThatAreNumbers) {
  for (const std::string value : {"", "-1", "1x", "+1", "0x1", "99999999999999999999999"}) {
    EXPECT_FALSE(parse_target("/?page=" + value)->number("page").has_value()) << value;
  }
  EXPECT_FALSE(parse_target("/")->number("page").has_value());
}

TEST(PercentEncoding, IsWhatParsingUndoes) {
  std::string every_byte;
  for (int byte = 1; byte < 256; ++byte) {
    if (byte != '/') every_byte += static_cast<char>(byte);
  }
  const auto request =
      parse_target("/" + percent_encoded(every_byte) + "?a=" + percent_encoded(every_byte));
  ASSERT_TRUE(request.has_value());
  EXPECT_THAT(request->path, ElementsAre(every_byte));
  EXPECT_EQ(request->text("a"), every_byte);
  EXPECT_EQ(percent_encoded("a b/<\"&"), "a%20b%2F%3C%22%26");
}

}  // namespace
}  // namespace proofmass::coordinator
