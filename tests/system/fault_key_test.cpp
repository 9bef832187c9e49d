// Strangers at the sockets of a coordinator with keys: nobody gets in, and both sides say why.

#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <regex>
#include <string>

#include "tests/system/fault_fixture.hpp"

namespace proofmass::test {
namespace {

namespace fs = std::filesystem;

class Keys : public FaultTest {
 protected:
  void SetUp() override {
    FaultTest::SetUp();
    write_null_campaign(500);
    workers_endpoint = "tcp://127.0.0.1:*";
    clients_endpoint = "tcp://127.0.0.1:*";
    for (const std::string name : {"keys", "other"}) {
      Process keygen = start_behind({}, "keygen", "proofmass", {"keygen", name});
      ASSERT_EQ(keygen.wait(), 0) << errors_of("keygen");
    }
    // With its own key, to the right coordinator; with the right key, to another coordinator.
    copy_keys("stranger", "other", "keys");
    copy_keys("misled", "keys", "other");
  }

  /// Starts the coordinator, at ports that it finds.
  void start_coordinator() {
    process_.reset(new Process(coordinator("coordinator", {"null.toml", "--keys", "keys"})));
    wait_for_log("coordinator", "coordinator_started");
    std::smatch found;
    const std::string log = errors_of("coordinator");
    EXPECT_TRUE(std::regex_search(log, found, std::regex("bind=(\\S+) bind_clients=(\\S+)")));
    workers_endpoint = found[1];
    clients_endpoint = found[2];
  }

  [[nodiscard]] std::string public_key(const std::string& directory_name,
                                       const std::string& role) const {
    std::istringstream words(read_file(path(directory_name) / (role + ".key")));
    std::string word;
    while (words >> word && word != "public") continue;
    words >> word;
    return word;
  }

  /// What a client says that is refused.
  [[nodiscard]] std::string refusal_of_client(const std::string& endpoint,
                                              const Arguments& further) const {
    Arguments arguments{"status", "--connect", endpoint};
    arguments.insert(arguments.end(), further.begin(), further.end());
    Process client = start_behind({}, "refused", "proofmass", arguments);
    EXPECT_EQ(client.wait(), 1);
    EXPECT_EQ(read_file(path("refused.out")), "");
    return errors_of("refused");
  }

  /// That no worker is registered, and one with the right key still can be.
  void expect_nobody_got_in() const {
    const auto status = nlohmann::json::parse(told({"status", "--json", "--keys", "keys"}));
    EXPECT_EQ(status.at("num_workers"), 0);
    EXPECT_EQ(num_done("null"), 0U);
    const Process worker = null_worker("right", {"--keys", "keys", "--run-time", "0"});
    wait_for_log("coordinator", "campaign_finished");
    EXPECT_EQ(stored_text(file_of("null"), "SELECT group_concat(worker) FROM worker"), "right");
    EXPECT_EQ(digest("null"), undisturbed_digest("null"));
  }

 private:
  void copy_keys(const std::string& name, const std::string& own,
                 const std::string& coordinators) const {
    fs::create_directory(path(name));
    fs::permissions(path(name), fs::perms::owner_all);
    for (const std::string key : {"worker.key", "client.key"}) {
      fs::copy_file(path(own) / key, path(name) / key);
    }
    fs::copy_file(path(coordinators) / "coordinator.pub", path(name) / "coordinator.pub");
  }

  std::unique_ptr<Process> process_;
};

TEST_F(Keys, KeepWorkersOutThatHaveNone) {
  start_coordinator();
  const Process worker = null_worker("plain");
  wait_for_log("plain", "give --keys");
  wait_for_log("coordinator", "peer_refused domain=workers address=unknown key=none reason=\"");
  expect_nobody_got_in();
}

TEST_F(Keys, KeepWorkersOutThatAreNotKnown) {
  start_coordinator();
  const Process worker = null_worker("stranger", {"--keys", "stranger"});
  const std::string key = public_key("stranger", "worker");
  wait_for_log("stranger", "connection_refused reason=\"key = " + key +
                               " (refused by the coordinator at " + workers_endpoint);
  wait_for_log("coordinator", "peer_refused domain=workers address=127.0.0.1 key=" + key +
                                  " reason=\"unknown key\"");
  expect_nobody_got_in();
}

TEST_F(Keys, KeepWorkersOutThatTrustAnotherCoordinator) {
  start_coordinator();
  const Process worker = null_worker("misled", {"--keys", "misled"});
  wait_for_log("misled", "it has another key than coordinator.pub");
  wait_for_log("coordinator", "reason=\"trusts the key of another coordinator\"");
  expect_nobody_got_in();
}

TEST_F(Keys, OfWorkersDoNotOpenTheDoorOfClients) {
  start_coordinator();
  const std::string key = public_key("keys", "worker");
  const Process worker = start_behind({}, "lost", "proofmass-null-worker",
                                      {"--connect", clients_endpoint, "--keys", "keys"});
  wait_for_log("lost", "key = " + key + " (refused by the coordinator");
  wait_for_log("coordinator", "peer_refused domain=clients address=127.0.0.1 key=" + key +
                                  " reason=\"key of a worker\"");
  expect_nobody_got_in();
}

TEST_F(Keys, KeepClientsOutThatHaveNoneOrTheWrongOne) {
  start_coordinator();
  EXPECT_TRUE(contains(refusal_of_client(clients_endpoint, {}),
                       "proofmass: error: coordinator = " + clients_endpoint + " ("));
  EXPECT_TRUE(contains(refusal_of_client(clients_endpoint, {"--keys", "misled"}),
                       "it has another key than coordinator.pub"));
  EXPECT_TRUE(contains(refusal_of_client(clients_endpoint, {"--keys", "stranger"}),
                       "key = " + public_key("stranger", "client") + " (refused"));
  EXPECT_TRUE(contains(refusal_of_client(workers_endpoint, {"--keys", "keys"}),
                       "key = " + public_key("keys", "client") + " (refused"));
  wait_for_log("coordinator", "peer_refused domain=clients address=unknown key=none reason=\"");
  wait_for_log("coordinator",
               "key=" + public_key("stranger", "client") + " reason=\"unknown key\"");
  wait_for_log("coordinator", "peer_refused domain=workers address=127.0.0.1 key=" +
                                  public_key("keys", "client") + " reason=\"key of a client\"");
  expect_nobody_got_in();
}

// `cat new > list`, an editor, a disk that is full for a moment.
TEST_F(Keys, WhoseListIsEmptyForAMomentEndNoWorker) {
  start_coordinator();
  const Process worker = null_worker("right", {"--keys", "keys", "--run-time", "0.1"});
  wait_for_done("null", 1);
  const std::string list = read_file(path("keys/authorized_workers"));
  std::ofstream(path("keys/authorized_workers")).close();
  wait_for_log("coordinator", "(is empty); the list before it stands");
  std::ofstream(path("keys/authorized_workers")) << list;
  wait_for_log("coordinator", "campaign_finished");
  EXPECT_EQ(num_log_lines("coordinator", "worker_gone"), 0U);
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

// A key is revoked by removing its line. The runs that its worker held go to another.
TEST_F(Keys, ThatAreRevokedEndTheWorkOfWhoHasThem) {
  Process keygen =
      start_behind({}, "keygen", "proofmass", {"keygen", "keys", "--worker", "second"});
  ASSERT_EQ(keygen.wait(), 0) << errors_of("keygen");
  fs::create_directory(path("seconds"));
  fs::copy_file(path("keys/second.key"), path("seconds/worker.key"));
  fs::copy_file(path("keys/coordinator.pub"), path("seconds/coordinator.pub"));
  const std::string key = public_key("keys", "second");

  start_coordinator();
  Process revoked = null_worker("revoked", {"--keys", "seconds", "--run-time", "0.5"});
  wait_for_done("null", 1);
  const std::string list = read_file(path("keys/authorized_workers"));
  std::ofstream(path("keys/authorized_workers.new"))
      << list.substr(0, list.find(key)) << list.substr(list.find('\n', list.find(key)) + 1);
  fs::rename(path("keys/authorized_workers.new"), path("keys/authorized_workers"));
  wait_for_log("coordinator", "key = " + key + " (is not authorized any more)");
  wait_for_log("revoked", "key = " + key + " (is not authorized any more)");

  const Process worker = null_worker("right", {"--keys", "keys", "--run-time", "0"});
  const Process again = null_worker("again", {"--keys", "seconds"});
  wait_for_log("coordinator", "key=" + key + " reason=\"unknown key\"");
  wait_for_log("coordinator", "campaign_finished");
  EXPECT_EQ(stored_text(file_of("null"), "SELECT count(*) FROM worker WHERE worker = 'again'"),
            "0");
  EXPECT_EQ(digest("null"), undisturbed_digest("null"));
}

// Whoever could read it could pass for its owner.
TEST_F(Keys, ThatOthersCanReadAreRefused) {
  const std::string rule = " (mode 0644; must be readable by its owner alone: chmod 600)\n";
  for (const std::string role : {"coordinator", "worker", "client"}) {
    fs::permissions(path("keys/" + role + ".key"), fs::perms(0644));
  }
  Process coordinator = this->coordinator("coordinator", {"--keys", "keys"});
  EXPECT_EQ(coordinator.wait(), 1);
  EXPECT_EQ(errors_of("coordinator"),
            "proofmass-coordinator: error: key file = keys/coordinator.key" + rule);
  Process worker = start_behind({}, "worker", "proofmass-worker",
                                {"--connect", "tcp://127.0.0.1:5555", "--keys", "keys"});
  EXPECT_EQ(worker.wait(), 1);
  EXPECT_EQ(errors_of("worker"), "proofmass-worker: error: key file = keys/worker.key" + rule);
  EXPECT_EQ(refusal_of_client("tcp://127.0.0.1:5556", {"--keys", "keys"}),
            "proofmass: error: key file = keys/client.key" + rule);
}

}  // namespace
}  // namespace proofmass::test
