#include "coordinator/cli/archive_commands.hpp"

#include <gtest/gtest.h>
#include <sqlite3.h>
#include <sys/stat.h>

#include <fstream>
#include <functional>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/export_command.hpp"
#include "coordinator/store/store.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
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

  static std::string printed_by(const std::function<int()>& command) {
    testing::internal::CaptureStdout();
    EXPECT_EQ(command(), exit_done);
    return testing::internal::GetCapturedStdout();
  }
  static std::string misuse(const std::function<int()>& command) {
    try {
      (void)command();
    } catch (const UsageError& error) {
      return error.what();
    }
    return {};
  }
  [[nodiscard]] std::string printed_tags() const {
    return printed_by([&] { return tag_database({.database = database_, .tags = {}}); });
  }

  const test::TemporaryDirectory directory_;
  const std::filesystem::path database_ = directory_ / "a.db";
};

TEST_F(ArchiveCommands, AddPrintAndRemoveTags) {
  EXPECT_EQ(tag_database({database_, TagAction::add, {"thesis", "flight"}}), exit_done);
  EXPECT_EQ(printed_tags(), "flight\nthesis\n");
  EXPECT_EQ(tag_database({database_, TagAction::remove, {"thesis"}}), exit_done);
  EXPECT_EQ(printed_tags(), "flight\n");
}

TEST_F(ArchiveCommands, AddAndRemoveAllTagsOrNone) {
  EXPECT_THROW((void)tag_database({database_, TagAction::add, {"flight", "not one"}}),
               InvalidArgument);
  EXPECT_EQ(printed_tags(), "");
  EXPECT_EQ(tag_database({database_, TagAction::add, {"flight"}}), exit_done);
  EXPECT_THROW((void)tag_database({database_, TagAction::remove, {"flight", "thesis"}}),
               StoreError);
  EXPECT_EQ(printed_tags(), "flight\n");
}

TEST_F(ArchiveCommands, NeedATagToAdd) {
  EXPECT_EQ(misuse([&] {
              return tag_database({database_, TagAction::add, {}});
            }),
            "TAG = (must be given after add and remove)");
}

TEST_F(ArchiveCommands, AddAndPrintNotes) {
  EXPECT_EQ(note_database({database_, "first line\nsecond"}), exit_done);
  const std::string printed = printed_by([&] { return note_database({database_, {}}); });
  EXPECT_EQ(printed.substr(20), "  first line\n" + std::string(22, ' ') + "second\n");
  EXPECT_EQ(printed.substr(0, 2), "20");
}

TEST_F(ArchiveCommands, CopyADatabase) {
  const auto copy = directory_ / "copy.db";
  EXPECT_EQ(printed_by([&] { return back_up_database(database_, copy); }),
            "wrote " + copy.string() + "\n");
  EXPECT_EQ(Store::open_read_only(copy).id(), Store::open_read_only(database_).id());
}

TEST_F(ArchiveCommands, DoNotBackUpOverAFile) {
  const auto copy = directory_ / "copy.db";
  std::ofstream(copy) << "mine";
  EXPECT_EQ(misuse([&] { return back_up_database(database_, copy); }),
            "destination = " + copy.string() + " (exists already)");
  EXPECT_EQ(std::filesystem::file_size(copy), 4U);
}

TEST_F(ArchiveCommands, DoNotExportOverAFile) {
  const auto output = directory_ / "a.csv";
  std::ofstream(output) << "mine";
  EXPECT_EQ(misuse([&] { return export_results({.database = database_, .output = output}); }),
            "output = " + output.string() + " (exists already; replace it with --force)");
  EXPECT_EQ(export_results({.database = database_, .output = output, .is_forced = true}),
            exit_done);
  std::string heading;
  std::ifstream(output) >> heading;
  EXPECT_EQ(heading.substr(0, 17), "run_index,status,");
}

// Also by another name of it.
TEST_F(ArchiveCommands, ExportOverNoCampaign) {
  const auto link = directory_ / "link.csv";
  std::filesystem::create_symlink(database_, link);
  for (const auto& output : {database_, link}) {
    EXPECT_EQ(misuse([&] {
                return export_results({.database = database_, .output = output, .is_forced = true});
              }),
              "output = " + output.string() + " (is a campaign, which --force does not replace)");
  }
  EXPECT_EQ(Store::open_read_only(database_).name(), "hardy2013");
}

TEST_F(ArchiveCommands, ExportOverNoDevice) {
  const auto pipe = directory_ / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_EQ(misuse([&] {
              return export_results({.database = database_, .output = pipe, .is_forced = true});
            }),
            "output = " + pipe.string() +
                " (is no file; leave --output out to write to a pipe or device)");
  EXPECT_TRUE(std::filesystem::is_fifo(pipe));
}

TEST_F(ArchiveCommands, ExportToStandardOutputByItsUsualName) {
  const std::string printed =
      printed_by([&] { return export_results({.database = database_, .output = "-"}); });
  EXPECT_EQ(printed.substr(0, 17), "run_index,status,");
  EXPECT_FALSE(std::filesystem::exists("-"));
}

// A name, a tag or a note of a file from elsewhere cannot steer the terminal.
TEST_F(ArchiveCommands, MakeVisibleWhatAFileSays) {
  sqlite3* connection = nullptr;
  ASSERT_EQ(sqlite3_open(database_.c_str(), &connection), SQLITE_OK);
  EXPECT_EQ(sqlite3_exec(connection, "UPDATE campaign SET name = char(27) || '[31m'", nullptr,
                         nullptr, nullptr),
            SQLITE_OK);
  const std::string listed = printed_by([&] { return list_databases({.places = {database_}}); });
  EXPECT_EQ(listed.find('\x1b'), std::string::npos) << listed;
  EXPECT_NE(listed.find("\\u001b[31m"), std::string::npos) << listed;

  // No program of ours writes such a tag.
  EXPECT_EQ(sqlite3_exec(connection, "INSERT INTO tag (tag) VALUES (char(27) || '[2J')", nullptr,
                         nullptr, nullptr),
            SQLITE_OK);
  sqlite3_close(connection);
  EXPECT_THROW((void)Store::open_read_only(database_).tags(), StoreError);
  const std::string problem = printed_by([&] { return list_databases({.places = {database_}}); });
  EXPECT_EQ(problem.find('\x1b'), std::string::npos) << problem;
  EXPECT_NE(problem.find("tag = \\u001b[2J"), std::string::npos) << problem;
}

TEST_F(ArchiveCommands, ExportHdf5ToAFileOnly) {
  EXPECT_EQ(
      misuse([&] {
        return export_results({.database = database_, .format = ExportFormat::hdf5, .output = {}});
      }),
      "output = - (must be a file for hdf5: name it with --output)");
}

TEST_F(ArchiveCommands, ListAndCompare) {
  EXPECT_NE(printed_by([&] { return list_databases({.places = {database_}}); }).find("a.db"),
            std::string::npos);
  EXPECT_EQ(printed_by([&] {
              return list_databases({.places = {database_}, .format = AnswerFormat::json});
            })[0],
            '{');
  EXPECT_NE(printed_by([&] {
              return compare_databases({.first = database_, .second = database_});
            }).find("The definitions agree."),
            std::string::npos);
}

TEST_F(ArchiveCommands, VerifyEndsWithOneIfACheckFails) {
  const std::string printed = printed_by([&] { return verify_database({.database = database_}); });
  EXPECT_NE(printed.find("integrity   ok "), std::string::npos) << printed;
  std::fstream file(database_, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(4096 + 3).write("\xff\xff", 2);  // Number of cells of the second page.
  file.close();
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  EXPECT_EQ(verify_database({.database = database_}), exit_cannot_be_done);
  EXPECT_NE(testing::internal::GetCapturedStdout().find("file        FAILS"), std::string::npos);
  EXPECT_EQ(testing::internal::GetCapturedStderr(),
            "proofmass: error: " + database_.string() + ": 1 of 11 checks fails\n");
}

}  // namespace
}  // namespace proofmass::coordinator
