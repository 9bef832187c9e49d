#include "coordinator/page/page.hpp"

#include "tests/coordinator/net/service_fixture.hpp"
#include "tests/coordinator/page/page_fixture.hpp"
#include "tests/coordinator/page/raw_client.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

const wire::Log no_log = [](const wire::Event&) {};

/// A page of a real service.
class PageOfServiceTest : public test::ServiceTest {
 protected:
  /// The answer, while the service comes round.
  std::string answer(Page& page, const std::string& target) {
    const std::string url = page.url();
    const auto port = static_cast<std::uint16_t>(std::stoul(url.substr(url.rfind(':') + 1)));
    std::future<std::string> given = std::async(
        std::launch::async, [port, target] { return test::RawClient(port).ask(target); });
    while (given.wait_for(std::chrono::milliseconds(1)) != std::future_status::ready) {
      in_service([&] { page.on_turn(*service); });
    }
    return given.get();
  }
  static PageConfig on_loopback() { return {.address = "127.0.0.1:0"}; }
};

TEST_F(PageOfServiceTest, ShowsTheCampaignsAndWorkersOfNow) {
  start({test::campaign_of("a", 10), test::campaign_of("b", 20)});
  Page page(on_loopback(), no_log);
  EXPECT_THAT(answer(page, "/"), HasSubstr(">a</a>"));
  EXPECT_THAT(answer(page, "/metrics"),
              AllOf(HasSubstr("proofmass_runs_wanted{campaign=\"a\"} 10\n"),
                    HasSubstr("proofmass_runs_wanted{campaign=\"b\"} 20\n"),
                    HasSubstr("proofmass_workers{state=\"idle\"} 0\n")));
}

TEST_F(PageOfServiceTest, ReadsTheDatabaseOfACampaign) {
  start({test::campaign_of("a", 10)});
  Page page(on_loopback(), no_log);
  in_service([&] { (void)service->campaigns(); });
  std::string shown;
  while (shown.find("<h2>Events</h2>") == std::string::npos) shown = answer(page, "/campaigns/a");
  // The definition that the fixture stores is none.
  EXPECT_THAT(shown, HasSubstr("cannot be read now: stored definition:1: "));
}

TEST_F(PageOfServiceTest, ForbidsTheBrowserWhatItDoesNotNeed) {
  start({test::campaign_of("a", 10)});
  Page page(on_loopback(), no_log);
  for (const std::string target : {"/", "/script.js", "/nothing", "/metrics"}) {
    const std::string given = answer(page, target);
    EXPECT_THAT(given, HasSubstr("Content-Security-Policy: default-src 'none'; ")) << target;
    EXPECT_THAT(given, HasSubstr("X-Content-Type-Options: nosniff\r\n")) << target;
    EXPECT_THAT(given, HasSubstr("Referrer-Policy: no-referrer\r\n")) << target;
    EXPECT_THAT(given, HasSubstr("Cache-Control: no-store\r\n")) << target;
  }
}

TEST(PageBeyondLoopback, WarnsThatNothingIsEncryptedWithoutTellingTheToken) {
  const test::ScratchDirectory directory;
  const auto file = directory / "token";
  std::ofstream(file) << test::page_secret;
  std::filesystem::permissions(file, std::filesystem::perms::owner_read);
  std::vector<std::string> lines;
  const Page page({.address = "*:0", .token_file = file},
                  [&](const wire::Event& event) { lines.push_back(to_text(event)); });
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_THAT(lines[0], StartsWith("page_served url=http://0.0.0.0:"));
  EXPECT_THAT(lines[1], StartsWith("page_not_encrypted url="));
  for (const std::string& line : lines) {
    EXPECT_THAT(line, testing::Not(HasSubstr(test::page_secret)));
  }
}

}  // namespace
}  // namespace proofmass::coordinator
