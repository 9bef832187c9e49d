#include <gtest/gtest.h>
#include <sqlite3.h>
#include <sys/stat.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/store/store.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/cli/program.hpp"
#include "tests/coordinator/cli/temporary_directory.hpp"

namespace proofmass::coordinator {
namespace {

/// A database without results.
class ArchiveCommands : public testing::Test {
 protected:
  ArchiveCommands() {
    const MicroscopeCampaign campaign = hardy2013_campaign();
    (void)Store::create(database_, campaign, canonical_definition(campaign));
  }

  static std::string printed_by(const std::vector<std::string>& arguments) {
    const test::Answer answer = test::answer_of(arguments);
    EXPECT_EQ(answer.exit_code, exit_done) << answer.error;
    return answer.output;
  }
  static std::string misuse(const std::vector<std::string>& arguments) {
    const test::Answer answer = test::answer_of(arguments);
    EXPECT_EQ(answer.exit_code, exit_wrong_usage);
    return answer.error;
  }

  const test::TemporaryDirectory directory_;
  const std::filesystem::path database_ = directory_ / "a.db";
};

TEST_F(ArchiveCommands, CopyADatabase) {
  const auto copy = directory_ / "copy.db";
  EXPECT_EQ(printed_by({"backup", database_, copy}), "wrote " + copy.string() + "\n");
  EXPECT_EQ(Store::open_read_only(copy).id(), Store::open_read_only(database_).id());
}

TEST_F(ArchiveCommands, PrintACopyAsJson) {
  using Json = nlohmann::json;
  const auto copy = directory_ / "copy.db";
  EXPECT_EQ(Json::parse(printed_by({"backup", database_, copy, "--json"})),
            (Json{{"file", copy.string()}}));
}

TEST_F(ArchiveCommands, CompareMoreThanTwoWithTheFirst) {
  const auto other = directory_ / "b.db";
  MicroscopeCampaign campaign = hardy2013_campaign();
  campaign.scenario.noise.scale = 2.0;
  (void)Store::create(other, campaign, canonical_definition(campaign));
  const std::string text = printed_by({"compare", database_, other, database_});
  EXPECT_NE(text.find("\nnoise.scale                1      A C\n"
                      "                           2      B\n"),
            std::string::npos)
      << text;
  const auto json =
      nlohmann::json::parse(printed_by({"compare", database_, other, database_, "--json"}));
  EXPECT_EQ(json["campaigns"].size(), 3U);
}

TEST_F(ArchiveCommands, CompareSixtyFourAtMost) {
  const std::vector<std::string> most(64, database_);
  std::vector<std::string> arguments{"compare"};
  arguments.insert(arguments.end(), most.begin(), most.end());
  EXPECT_EQ(test::answer_of(arguments).exit_code, exit_done);
  arguments.push_back(database_);
  EXPECT_EQ(misuse(arguments), "DB = 65 files (must be at most 64)");
}

TEST_F(ArchiveCommands, DoNotBackUpOverAFile) {
  const auto copy = directory_ / "copy.db";
  std::ofstream(copy) << "mine";
  EXPECT_EQ(misuse({"backup", database_, copy}),
            "destination = " + copy.string() + " (exists already)");
  EXPECT_EQ(std::filesystem::file_size(copy), 4U);
}

TEST_F(ArchiveCommands, NeedADirectoryForABackup) {
  const auto copy = directory_ / "none" / "copy.db";
  const test::Answer answer = test::answer_of({"backup", database_, copy});
  EXPECT_EQ(answer.exit_code, exit_cannot_be_done);
  EXPECT_EQ(answer.error, "destination = " + copy.string() + " (its directory does not exist)");
}

TEST_F(ArchiveCommands, DoNotExportOverAFile) {
  const auto output = directory_ / "a.csv";
  std::ofstream(output) << "mine";
  EXPECT_EQ(misuse({"export", database_, "--output", output}),
            "output = " + output.string() + " (exists already; replace it with --force)");
  EXPECT_EQ(printed_by({"export", database_, "--output", output, "--force"}), "");
  std::string heading;
  std::getline(std::ifstream(output), heading);
  EXPECT_EQ(heading, "\x89HDF\r");
}

TEST_F(ArchiveCommands, ExportToAFileOfAKnownFormat) {
  EXPECT_EQ(misuse({"export", database_}),
            "--output is required; usage: proofmass export [OPTIONS] DB");
  EXPECT_EQ(misuse({"export", database_, "--output", "-"}), "output = - (must be a file)");
  EXPECT_EQ(misuse({"export", database_, "--format", "csv", "--output", "a.csv"}),
            "--format = csv (must be one of hdf5, sqlite)");
}

// Nor over a link, whatever it leads to.
TEST_F(ArchiveCommands, ExportOverNoCampaign) {
  const auto link = directory_ / "link.csv";
  std::filesystem::create_symlink(database_, link);
  EXPECT_EQ(misuse({"export", database_, "--output", database_, "--force"}),
            "output = " + database_.string() + " (is a campaign, which --force does not replace)");
  EXPECT_EQ(misuse({"export", database_, "--output", link, "--force"}),
            "output = " + link.string() + " (is a symbolic link; name the file that it leads to)");
  EXPECT_EQ(Store::open_read_only(database_).name(), "hardy2013");
}

TEST_F(ArchiveCommands, ExportOverNoDevice) {
  const auto pipe = directory_ / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(misuse({"export", database_, "--output", pipe, "--force"}),
            "output = " + pipe.string() + " (is no file; name one that may be replaced)");
  EXPECT_TRUE(std::filesystem::is_fifo(pipe));
}

// The name of a campaign in a file from elsewhere cannot steer the terminal.
TEST_F(ArchiveCommands, MakeVisibleWhatAFileSays) {
  sqlite3* connection = nullptr;
  ASSERT_EQ(sqlite3_open(database_.c_str(), &connection), SQLITE_OK);
  EXPECT_EQ(sqlite3_exec(connection, "UPDATE campaign SET name = char(27) || '[31m'", nullptr,
                         nullptr, nullptr),
            SQLITE_OK);
  const std::string listed = printed_by({"list", database_});
  EXPECT_EQ(listed.find('\x1b'), std::string::npos) << listed;
  EXPECT_NE(listed.find("\\u001b[31m"), std::string::npos) << listed;
  sqlite3_close(connection);
}

TEST_F(ArchiveCommands, ListAndCompare) {
  EXPECT_NE(printed_by({"list", database_}).find("a.db"), std::string::npos);
  EXPECT_EQ(printed_by({"list", database_, "--json"})[0], '{');
  EXPECT_NE(printed_by({"compare", database_, database_}).find("The definitions agree."),
            std::string::npos);
}

TEST_F(ArchiveCommands, VerifyEndsWithOneIfACheckFails) {
  const std::string printed = printed_by({"verify", database_});
  EXPECT_NE(printed.find("integrity   ok "), std::string::npos) << printed;
  std::fstream file(database_, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(4096 + 3).write("\xff\xff", 2);  // Number of cells of the second page.
  file.close();
  const test::Answer answer = test::answer_of({"verify", database_});
  EXPECT_EQ(answer.exit_code, exit_cannot_be_done);
  EXPECT_NE(answer.output.find("file        FAILS"), std::string::npos);
  EXPECT_EQ(answer.error, database_.string() + ": 1 of 11 checks fails");
}

}  // namespace
}  // namespace proofmass::coordinator
