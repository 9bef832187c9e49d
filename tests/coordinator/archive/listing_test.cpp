#include "coordinator/archive/listing.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "coordinator/table/terminal_table.hpp"
#include "tests/coordinator/archive/archive_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::HasSubstr;

class Listing : public test::StoreTest {
 protected:
  std::filesystem::path make(const std::string& name) const {
    const std::filesystem::path path = directory() / name;
    (void)Store::create(path, test::campaign_of(10), "");
    return path;
  }
  static std::string refusal(const std::filesystem::path& place) {
    const std::vector<std::filesystem::path> places{place};
    return test::error_of([&] { (void)list_campaigns(places); });
  }
};

TEST_F(Listing, SaysWhichDirectoryItCannotRead) {
  const auto closed = directory() / "closed";
  std::filesystem::create_directory(closed);
  std::filesystem::permissions(directory(), std::filesystem::perms::all);
  std::filesystem::permissions(closed, std::filesystem::perms::none);
  std::string error;
  {
    const test::OrdinaryUser user;
    error = refusal(closed);
  }
  std::filesystem::permissions(closed, std::filesystem::perms::all);
  EXPECT_EQ(error, "directory = " + closed.string() + " (cannot be read: Permission denied)");
}

TEST_F(Listing, NamesAFileThatItMayNotRead) {
  const auto closed = make("closed.db");
  std::filesystem::permissions(directory(), std::filesystem::perms::all);
  std::filesystem::permissions(closed, std::filesystem::perms::none);
  const test::OrdinaryUser user;
  for (const auto& place : {directory(), closed}) {
    const auto campaigns = list_campaigns({&place, 1});
    ASSERT_EQ(campaigns.size(), 1U);
    EXPECT_EQ(campaigns[0].problem, "campaign database = " + closed.string() +
                                        " (unable to open database file: Permission denied)");
  }
}

const ListedCampaign extreme{.file = "/some/where/a-file-with-a-rather-long-name.db",
                             .problem = "",
                             .name = "a campaign with a long name, too",
                             .seed = 18446744073709551615U,
                             .num_runs = 1'000'000'000,
                             .num_finished = 999'999'999,
                             .phase = wire::CampaignPhase::cancelled,
                             .created_utc = "2024-02-29T12:00:10Z"};

TEST(ListingText, FitsATerminal) {
  const std::string text = terminal_text(listing_table({&extreme, 1}), {.line_width_max = 80});
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(display_width(line), 80U) << line;
  EXPECT_THAT(text, HasSubstr("… "));
  EXPECT_THAT(text, HasSubstr(" cancell… "));
  EXPECT_THAT(text, HasSubstr(" 18446744073709551615 2024-02-29\n"));
}

TEST(ListingJson, IsComplete) {
  const ListedCampaign damaged{.file = "b.db", .problem = "is damaged"};
  const std::vector<ListedCampaign> campaigns{extreme, damaged};
  const auto json = nlohmann::json::parse(listing_json(campaigns))["campaigns"];
  EXPECT_EQ(json[0]["file"], "/some/where/a-file-with-a-rather-long-name.db");
  EXPECT_TRUE(json[0]["problem"].is_null());
  EXPECT_EQ(json[0]["seed"], "18446744073709551615");
  EXPECT_EQ(json[0]["phase"], "cancelled");
  EXPECT_EQ(json[0]["num_runs"], 1'000'000'000);
  EXPECT_EQ(json[0]["num_finished"], 999'999'999);
  EXPECT_EQ(json[0]["created_utc"], "2024-02-29T12:00:10Z");
  EXPECT_EQ(json[1], nlohmann::json({{"file", "b.db"}, {"problem", "is damaged"}}));
}

}  // namespace
}  // namespace proofmass::coordinator
