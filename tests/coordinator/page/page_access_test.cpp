#include "coordinator/page/page_access.hpp"

#include "core/error.hpp"
#include "tests/coordinator/page/page_fixture.hpp"
#include "tests/proto/link/scratch_directory.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using test::page_secret;

std::string header_of(const HttpAnswer& answer, const std::string& name) {
  for (const auto& [key, value] : answer.headers) {
    if (key == name) return value;
  }
  return "";
}

TEST(PageAddress, OfThisMachineIsLoopback) {
  EXPECT_TRUE(parse_page_address(page_address_by_default).is_loopback);
  for (const std::string text : {"127.0.0.1:80", "localhost:80", "127.9.9.9:80", "[::1]:80"}) {
    EXPECT_TRUE(parse_page_address(text).is_loopback) << text;
    EXPECT_EQ(parse_page_address(text).port, 80) << text;
  }
  for (const std::string text : {"0.0.0.0:80", "*:80", "[::]:80", "192.168.1.2:80", "[fe80::1]:80",
                                 "[::ffff:127.0.0.1]:80"}) {
    EXPECT_FALSE(parse_page_address(text).is_loopback) << text;
  }
}

TEST(PageAddress, HasAUrl) {
  EXPECT_EQ(url_of(parse_page_address("localhost:5557")), "http://127.0.0.1:5557/");
  EXPECT_EQ(url_of(parse_page_address("[::1]:80")), "http://[::1]:80/");
}

TEST(PageAddress, ThatIsNoneIsRefused) {
  for (const std::string text :
       {"", "5557", "127.0.0.1", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:-1", "127.0.0.1:x",
        "example.org:80", "::1:80", "[::1]", "[::1:80", "1.2.3:80", "mine.toml", ":80"}) {
    EXPECT_EQ(test::message_of<InvalidArgument>([&] { (void)parse_page_address(text); }),
              "page = " + text +
                  " (must be HOST:PORT, with localhost, * or the address of an interface and a "
                  "port up to 65535; IPv6 in brackets)");
  }
}

TEST(LoopbackHost, IsThisMachineByNameOrAddress) {
  for (const std::string host :
       {"localhost", "LocalHost:5557", "127.0.0.1", "127.1.2.3:80", "[::1]", "[::1]:5557"}) {
    EXPECT_TRUE(is_loopback_host(host)) << host;
  }
  for (const std::string host :
       {"", "evil.example", "localhost.evil.example", "127.0.0.1.evil.example", "1.2.3.4",
        "[::1].evil.example", "[::2]", "[::1]x", "evil.example:5557", "127.0.0.1@evil.example"}) {
    EXPECT_FALSE(is_loopback_host(host)) << host;
  }
}

TEST(PageWithoutToken, IsForThisMachineAlone) {
  const PageAccess access;
  EXPECT_FALSE(access.refusal_of({.host = "localhost:5557"}).has_value());
  const auto refusal = access.refusal_of({.host = "evil.example:5557"});
  ASSERT_TRUE(refusal.has_value());
  EXPECT_EQ(refusal->status, 403U);
  EXPECT_FALSE(access.welcome(page_secret).has_value());
}

TEST(PageWithToken, AsksForIt) {
  const PageAccess access(page_secret);
  const auto status = [&](const HttpRequest& request) {
    const auto refusal = access.refusal_of(request);
    return refusal ? refusal->status : 200U;
  };
  EXPECT_EQ(status({.host = "localhost"}), 401U);
  EXPECT_EQ(status({.authorization = "Bearer " + page_secret}), 200U);
  EXPECT_EQ(status({.authorization = "bearer " + page_secret}), 200U);
  EXPECT_EQ(status({.authorization = "BEARER   " + page_secret}), 200U);
  EXPECT_EQ(status({.authorization = "Bearer" + page_secret}), 401U);
  EXPECT_EQ(status({.authorization = "Basic " + page_secret}), 401U);
  EXPECT_EQ(status({.authorization = "Bearer " + page_secret + "x"}), 401U);
  EXPECT_EQ(status({.authorization = "Bearer "}), 401U);
  EXPECT_EQ(status({.authorization = page_secret}), 401U);
  EXPECT_EQ(status({.cookie = page_secret}), 401U);  // The cookie is another word.
  EXPECT_EQ(status({.cookie = ""}), 401U);
}

TEST(PageWithToken, LeadsToTheFrontPageFromEachAddress) {
  const PageAccess access(page_secret);
  const auto body = [&](const std::string& target) {
    return access.refusal_of({.target = target}).value_or(HttpAnswer{}).body;
  };
  EXPECT_THAT(body("/?token=a/b/c"), HasSubstr("<a href=\"./\">front page"));
  EXPECT_THAT(body("/workers?sort=a"), HasSubstr("<a href=\"./\">front page"));
  EXPECT_THAT(body("/campaigns/a"), HasSubstr("<a href=\"./../\">front page"));
  EXPECT_THAT(body("/campaigns/a/b"), HasSubstr("<a href=\"./../../\">front page"));
}

TEST(PageWithToken, GivesACookieForIt) {
  const PageAccess access(page_secret);
  EXPECT_FALSE(access.welcome("another-secret-of-20").has_value());
  EXPECT_FALSE(access.welcome("").has_value());
  const auto welcome = access.welcome(page_secret);
  ASSERT_TRUE(welcome.has_value());
  EXPECT_EQ(welcome->status, 303U);
  EXPECT_EQ(header_of(*welcome, "Location"), "./");
  const std::string cookie = header_of(*welcome, "Set-Cookie");
  EXPECT_THAT(cookie, HasSubstr("; HttpOnly; SameSite=Strict"));
  EXPECT_THAT(cookie, Not(HasSubstr(page_secret)));
  const std::string pair = cookie.substr(0, cookie.find(';'));
  EXPECT_FALSE(access.refusal_of({.cookie = pair}).has_value());
  EXPECT_FALSE(access.refusal_of({.cookie = "a=b; " + pair + "; c=d"}).has_value());
  EXPECT_TRUE(access.refusal_of({.cookie = "x" + pair}).has_value());
  const PageAccess other("another-secret-of-20");
  EXPECT_TRUE(other.refusal_of({.cookie = pair}).has_value());
  // A browser sends the cookies of all pages of a host to each of them.
  const std::string of_other =
      header_of(other.welcome("another-secret-of-20").value(), "Set-Cookie");
  EXPECT_NE(of_other.substr(0, of_other.find('=')), pair.substr(0, pair.find('=')));
}

class TokenFileTest : public ::testing::Test {
 protected:
  std::filesystem::path write(const std::string& text, std::filesystem::perms mode) {
    const std::filesystem::path file = directory_ / "token";
    std::ofstream(file, std::ios::binary) << text;
    std::filesystem::permissions(file, mode);
    return file;
  }
  /// Of the error that begins with the name of the file.
  std::string rule_for(const std::filesystem::path& file) {
    const std::string message = test::message_of<Error>([&] { (void)PageAccess::read(file); });
    EXPECT_THAT(message, testing::StartsWith("page token file = " + file.string() + " ("));
    EXPECT_THAT(message, Not(HasSubstr("secret")));
    return message;
  }
  static constexpr auto owner_only =
      std::filesystem::perms::owner_read | std::filesystem::perms::owner_write;

 private:
  test::ScratchDirectory directory_;
};

TEST_F(TokenFileTest, HoldsTheToken) {
  EXPECT_TRUE(PageAccess::read(write(page_secret, owner_only)).welcome(page_secret).has_value());
  EXPECT_TRUE(
      PageAccess::read(write(page_secret + "\n", owner_only)).welcome(page_secret).has_value());
  EXPECT_FALSE(
      PageAccess::read(write(page_secret, owner_only)).welcome(page_secret + "\n").has_value());
}

TEST_F(TokenFileTest, MustBePrivate) {
  EXPECT_THAT(rule_for(write(page_secret, owner_only | std::filesystem::perms::group_read)),
              HasSubstr("mode 0640; must be readable by its owner alone: chmod 600"));
}

TEST_F(TokenFileTest, MustHoldEnoughAndNothingElse) {
  const std::string rule = "must hold 16 to 256 visible ASCII characters and nothing else";
  for (const std::string& text :
       {std::string(), std::string("secret-of-15-si"), "secret with blank" + page_secret,
        page_secret + "\n\n", page_secret + "\r\n", page_secret + "é",
        "secret" + std::string(251, 'x')}) {
    EXPECT_THAT(rule_for(write(text, owner_only)), HasSubstr(rule)) << text;
  }
}

TEST_F(TokenFileTest, MustBeThere) {
  EXPECT_THAT(rule_for("/nowhere/token"), HasSubstr("No such file or directory"));
  EXPECT_THAT(rule_for("/dev"), HasSubstr("must be a regular file"));
}

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
