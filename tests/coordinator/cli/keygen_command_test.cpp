#include <gtest/gtest.h>
#include <sys/stat.h>

#include <set>
#include <string>
#include <vector>

#include "coordinator/cli/program.hpp"
#include "coordinator/net/authentication/allow_list.hpp"
#include "proto/link/keys.hpp"
#include "tests/coordinator/cli/program.hpp"
#include "tests/proto/link/scratch_directory.hpp"

namespace proofmass::coordinator {
namespace {

using test::mode_of;
using test::ScratchDirectory;
using test::text_of;
using wire::KeyRole;

class Keygen : public ::testing::Test {
 protected:
  void make_whole_set() { (void)keygen({}); }

  /// With these arguments behind the directory.
  [[nodiscard]] test::Answer keygen(const std::vector<std::string>& arguments) const {
    std::vector<std::string> all{"keygen", directory_};
    all.insert(all.end(), arguments.begin(), arguments.end());
    return test::answer_of(all);
  }
  [[nodiscard]] std::string refusal(const std::vector<std::string>& arguments) const {
    const test::Answer answer = keygen(arguments);
    EXPECT_EQ(answer.exit_code, exit_wrong_usage);
    return answer.error;
  }

  ScratchDirectory scratch_;
  std::filesystem::path directory_ = scratch_ / "keys";
};

TEST_F(Keygen, MakesAllThatACoordinatorItsWorkersAndClientsNeed) {
  make_whole_set();
  const auto server = wire::read_server_security(directory_, wire::Domain::workers);
  const auto worker = wire::read_client_security(directory_, KeyRole::worker);
  const auto client = wire::read_client_security(directory_, KeyRole::client);
  EXPECT_EQ(worker.identity->coordinator, server.keys->public_key);
  EXPECT_EQ(client.identity->coordinator, server.keys->public_key);

  const AllowList workers(directory_ / "authorized_workers", wire::Domain::workers);
  const AllowList clients(directory_ / "authorized_clients", wire::Domain::clients);
  ASSERT_NE(workers.owner_of(worker.identity->keys.public_key.text()), nullptr);
  EXPECT_EQ(workers.owner_of(worker.identity->keys.public_key.text())->name, "worker");
  EXPECT_EQ(workers.owner_of(client.identity->keys.public_key.text()), nullptr);
  ASSERT_NE(clients.owner_of(client.identity->keys.public_key.text()), nullptr);
  EXPECT_EQ(clients.owner_of(worker.identity->keys.public_key.text()), nullptr);
  // Whoever sets it up may control everything.
  const AllowedKey& first = *clients.owner_of(client.identity->keys.public_key.text());
  EXPECT_EQ(first.rights, Rights::all());
}

TEST_F(Keygen, KeepsSecretsToTheirOwner) {
  const mode_t before = ::umask(0);
  make_whole_set();
  ::umask(before);
  EXPECT_EQ(mode_of(directory_), 0700u);
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(directory_)) {
    const bool is_secret = entry.path().extension() == ".key";
    EXPECT_EQ(mode_of(entry.path()), is_secret ? 0600u : 0644u) << entry.path();
    names.insert(entry.path().filename().string());
  }
  EXPECT_EQ(names, (std::set<std::string>{"coordinator.key", "coordinator.pub", "worker.key",
                                          "worker.pub", "client.key", "client.pub",
                                          "authorized_workers", "authorized_clients"}));
}

TEST_F(Keygen, SaysWhatToCopyWhereAndNoSecret) {
  const test::Answer answer = keygen({});
  EXPECT_EQ(answer.exit_code, exit_done);
  const std::string path = directory_.string();
  EXPECT_EQ(answer.output,
            "wrote " + path +
                "\nKeep this directory on the coordinator's machine:\n"
                "  proofmass-coordinator --keys " +
                path +
                "\nThe coordinator admits the keys in authorized_workers and authorized_clients.\n"
                "A host of workers (proofmass-worker --keys) needs\n"
                "a directory with two files, readable by its user alone:\n  " +
                path + "/worker.key\n  " + path +
                "/coordinator.pub\n"
                "A person who submits and watches (proofmass --keys) needs\n"
                "a directory with two files, readable by its user alone:\n  " +
                path + "/client.key\n  " + path + "/coordinator.pub\n");
}

TEST_F(Keygen, ReplacesNothing) {
  make_whole_set();
  const std::string before = text_of(directory_ / "coordinator.key");
  const std::string tail = " (exists; keys are never replaced)";
  EXPECT_EQ(refusal({}), "key file = " + (directory_ / "coordinator.key").string() + tail);
  EXPECT_EQ(text_of(directory_ / "coordinator.key"), before);

  std::filesystem::remove(directory_ / "coordinator.key");
  EXPECT_EQ(refusal({}), "key file = " + (directory_ / "coordinator.pub").string() + tail);
  EXPECT_FALSE(std::filesystem::exists(directory_ / "coordinator.key"));
}

TEST_F(Keygen, AddsAPairAndItsLine) {
  make_whole_set();
  const std::string output = keygen({"--worker", "cluster-2"}).output;
  EXPECT_NE(output.find((directory_ / "cluster-2.key").string() + "  as worker.key\n"),
            std::string::npos)
      << output;
  const auto pair = wire::read_key_pair(directory_ / "cluster-2.key", KeyRole::worker);
  const AllowList workers(directory_ / "authorized_workers", wire::Domain::workers);
  ASSERT_NE(workers.owner_of(pair.public_key.text()), nullptr);
  EXPECT_EQ(workers.owner_of(pair.public_key.text())->name, "cluster-2");
  const auto first = wire::read_public_key(directory_ / "worker.pub", KeyRole::worker);
  EXPECT_NE(workers.owner_of(first.text()), nullptr);
}

TEST_F(Keygen, AddsToAListThatAPersonHasEdited) {
  make_whole_set();
  test::write_text(directory_ / "authorized_clients", "# mine alone", 0644);
  (void)keygen({"--client", "anna"});
  const std::string key = wire::read_public_key(directory_ / "anna.pub", KeyRole::client).text();
  EXPECT_EQ(text_of(directory_ / "authorized_clients"), "# mine alone\n" + key + " anna\n");
}

TEST_F(Keygen, RefusesAPairThatMakesNoSense) {
  const std::vector<std::string> worker{"--worker", "w2"};
  EXPECT_EQ(refusal(worker), "allow-list = " + (directory_ / "authorized_workers").string() +
                                 " (No such file or directory; `proofmass keygen DIR` makes one)");
  make_whole_set();
  (void)keygen(worker);
  EXPECT_EQ(refusal(worker),
            "--worker = w2 (is in " + (directory_ / "authorized_workers").string() + " already)");
  EXPECT_EQ(refusal({"--client", "w2"}), "key file = " + (directory_ / "w2.key").string() +
                                             " (exists; keys are never replaced)");
  EXPECT_EQ(refusal({"--worker", "../x"}),
            "--worker = ../x (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first)");
}

TEST_F(Keygen, RefusesADirectoryThatCannotBeMade) {
  const std::filesystem::path file = scratch_ / "file";
  test::write_text(file, "", 0644);
  const test::Answer answer = test::answer_of({"keygen", file / "keys"});
  EXPECT_EQ(answer.exit_code, exit_cannot_be_done);
  EXPECT_EQ(answer.error, "key directory = " + (file / "keys").string() + " (Not a directory)");
}

}  // namespace
}  // namespace proofmass::coordinator
