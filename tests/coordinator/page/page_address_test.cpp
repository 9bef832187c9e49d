#include "coordinator/page/page_address.hpp"

#include <gtest/gtest.h>

#include <string>

#include "core/error.hpp"
#include "tests/message_of.hpp"

namespace proofmass::coordinator {
namespace {

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

}  // namespace
}  // namespace proofmass::coordinator
