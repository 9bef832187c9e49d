#include "coordinator/archive/listing.hpp"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "coordinator/table/terminal_table.hpp"
#include "tests/coordinator/archive/archive_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

class Listing : public test::StoreTest {
 protected:
  std::filesystem::path make(const std::string& name, std::uint64_t num_finished = 0) const {
    const std::filesystem::path path = directory() / name;
    Store store = Store::create(path, test::campaign_of(10), "");
    (void)store.commit(test::deliveries_of(0, num_finished));
    return path;
  }

  [[nodiscard]] std::vector<ListedCampaign> list() const {
    const std::vector<std::filesystem::path> places{directory()};
    return list_campaigns(places);
  }
  static std::string refusal(const std::filesystem::path& place) {
    const std::vector<std::filesystem::path> places{place};
    return test::error_of([&] { (void)list_campaigns(places); });
  }
};

TEST_F(Listing, TellsWhereEachCampaignStands) {
  const auto path = make("b.db", 3);
  make("a.db");
  const auto campaigns = list();
  ASSERT_EQ(campaigns.size(), 2U);
  EXPECT_EQ(campaigns[0].file, directory() / "a.db");
  const ListedCampaign& campaign = campaigns[1];
  EXPECT_EQ(campaign.file, path);
  EXPECT_EQ(campaign.problem, "");
  EXPECT_EQ(campaign.name, "hardy2013");
  EXPECT_EQ(campaign.seed, 1U);
  EXPECT_EQ(campaign.num_runs, 10U);
  EXPECT_EQ(campaign.num_finished, 3U);
  EXPECT_EQ(campaign.phase, wire::CampaignPhase::active);
  EXPECT_EQ(campaign.created_utc, Store::open_read_only(path).created_utc());
}

TEST_F(Listing, LeavesOtherFilesOutOfDirectories) {
  make("a.db");
  make("not a database by its name.txt");
  test::write_file(directory() / "text.db", "text");
  test::write_file(directory() / "empty.db", "");
  std::filesystem::create_directory(directory() / "directory.db");
  ASSERT_EQ(::mkfifo((directory() / "pipe.db").c_str(), 0600), 0);  // Nobody writes to it.
  test::change(directory() / "a.db", "VACUUM INTO '" + (directory() / "foreign.db").string() + "'");
  test::change(directory() / "foreign.db", "PRAGMA application_id = 7");
  EXPECT_EQ(list().size(), 1U);
}

TEST_F(Listing, SaysWhatIsWrongWithACampaignFile) {
  make("a.db", 10);
  make("newer.db");
  make("older.db");
  const std::string whole = test::content_of(directory() / "a.db");
  test::write_file(directory() / "damaged.db", whole.substr(0, whole.size() / 2));
  test::change(directory() / "newer.db", "PRAGMA user_version = 99");
  test::change(directory() / "older.db", "PRAGMA user_version = 3");
  const auto campaigns = list();
  ASSERT_EQ(campaigns.size(), 4U);
  EXPECT_EQ(campaigns[0].problem, "");
  EXPECT_THAT(campaigns[1].problem, HasSubstr("damaged"));
  EXPECT_THAT(campaigns[2].problem, HasSubstr("is newer than this program"));
  EXPECT_THAT(campaigns[3].problem, HasSubstr("was made before the first release"));
  const std::string text = terminal_text(listing_table(campaigns));
  EXPECT_THAT(text, HasSubstr("\n" + campaigns[1].problem + "\n"));
}

TEST_F(Listing, RefusesAFileOfAnotherKindThatIsNamed) {
  const std::string path = file().string();
  EXPECT_EQ(refusal(file()), "campaign database = " + path + " (does not exist)");
  test::write_file(file(), "text");
  EXPECT_EQ(refusal(file()), "campaign database = " + path + " (is not a Proofmass campaign)");
}

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

TEST_F(Listing, NamesDamagedFilesThatAreNamed) {
  make("a.db");
  const std::string whole = test::content_of(directory() / "a.db");
  test::write_file(file(), whole.substr(0, whole.size() / 2));
  const std::vector<std::filesystem::path> places{file()};
  const auto campaigns = list_campaigns(places);
  ASSERT_EQ(campaigns.size(), 1U);
  EXPECT_THAT(campaigns[0].problem, StartsWith("campaign database = " + file().string()));
}

TEST_F(Listing, OfNothingSaysSo) {
  EXPECT_THAT(list(), IsEmpty());
  EXPECT_EQ(terminal_text(listing_table({})), "no campaigns\n");
  EXPECT_EQ(nlohmann::json::parse(listing_json({}))["campaigns"].size(), 0U);
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
  EXPECT_THAT(text, HasSubstr("cancelled"));
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
