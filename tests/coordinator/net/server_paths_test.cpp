#include "coordinator/net/server_paths.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {
namespace {

TEST(ServerPaths, NameFilesWithinTheDirectoryOfCampaigns) {
  const ServerPaths paths("my data/served");
  const std::string whole = std::filesystem::absolute("my data/served").string();
  EXPECT_EQ(paths.hidden_in("campaign database = my data/served/a.db (is locked)"),
            "campaign database = a.db (is locked)");
  EXPECT_EQ(paths.hidden_in(whole + "/a.db: it is " + whole + "/archived/a.db now"),
            "a.db: it is archived/a.db now");
}

// Which are those of a client's own words.
TEST(ServerPaths, LeaveOtherPathsAsTheyAre) {
  const std::string text = "option = /etc/shadow, observed/a.db, 3 m/s\u00b2 (1/2, tcp://*:5556)";
  for (const ServerPaths& paths : {ServerPaths("served"), ServerPaths("")}) {
    EXPECT_EQ(paths.hidden_in(text), text);
  }
}

TEST(ServerPaths, AreInNoReply) {
  const ServerPaths paths("served");
  wire::StatusReply shown;
  shown.campaigns.emplace_back().storage_failure = "file = served/a.db (full)";
  shown.unserved_files = {{.file = "served/b.db", .reason = "file = served/b.db (locked)"}};
  paths.hide_in(shown);
  EXPECT_EQ(shown.campaigns[0].storage_failure, "file = a.db (full)");
  EXPECT_EQ(shown.unserved_files[0].file, "b.db");
  EXPECT_EQ(shown.unserved_files[0].reason, "file = b.db (locked)");
  proto::ReplyEnvelope error = wire::error_reply("file = served/b.db (locked)");
  paths.hide_in(error);
  EXPECT_EQ(error.error().text(), "file = b.db (locked)");
}

}  // namespace
}  // namespace proofmass::coordinator
