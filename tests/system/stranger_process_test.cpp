// What somebody tries who can reach a coordinator and has nothing good in mind: silent connections
// to the page, questions that need much, names that are options or directories, files without an
// end. With real processes.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "tests/coordinator/page/raw_client.hpp"
#include "tests/system/campaign_process.hpp"

namespace proofmass::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

/// A coordinator with one campaign and no workers.
class Stranger : public CampaignProcess {
 protected:
  void start_coordinator(const Arguments& further = {}) {
    Arguments arguments{"short.toml", "--directory", "served", "--bind",
                        "ipc://" + path("socket").string()};
    arguments.insert(arguments.end(), further.begin(), further.end());
    coordinator_ = std::make_unique<Process>(directory / "", "coordinator",
                                             programs + "/proofmass-coordinator", arguments);
    wait_until("coordinator", [&] { return log_has("coordinator_started"); });
  }
  [[nodiscard]] bool log_has(const std::string& text) const {
    return contains(errors_of("coordinator"), text);
  }
  void start_with_page(const Arguments& further = {}) {
    Arguments arguments{"--page=127.0.0.1:0"};
    arguments.insert(arguments.end(), further.begin(), further.end());
    start_coordinator(arguments);
    wait_until("page", [&] { return log_has("page_served"); });
    const std::string log = errors_of("coordinator");
    const std::string beginning = "http://127.0.0.1:";
    port_ =
        static_cast<std::uint16_t>(std::stoul(log.substr(log.find(beginning) + beginning.size())));
  }
  [[nodiscard]] std::string page(const std::string& target) const {
    return RawClient(port_).ask(target);
  }

  int command(const Arguments& arguments) const {
    return Process(directory / "", "command", programs + "/proofmass", arguments).wait();
  }
  int remote(Arguments arguments) const {
    arguments.insert(arguments.end(), {"--connect", "ipc://" + path("served/clients").string()});
    return command(arguments);
  }
  [[nodiscard]] std::string output() const { return read_file(path("command.out")); }
  [[nodiscard]] std::string errors() const { return errors_of("command"); }

  std::uint16_t port_ = 0;

 private:
  std::unique_ptr<Process> coordinator_;
};

/// Silent connections, and such as send half of a header.
std::vector<std::unique_ptr<RawClient>> crowd(std::uint16_t port, const std::string& address,
                                              int count) {
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < count; ++i) {
    clients.push_back(std::make_unique<RawClient>(port, address));
    if (i % 2 == 0) clients.back()->send("GET / HTTP/1.1\r\nX-A: ");
  }
  return clients;
}

TEST_F(Stranger, CannotCloseThePageWithSilentConnections) {
  start_with_page();
  const auto here = crowd(port_, "127.0.0.1", 100);
  const auto elsewhere = crowd(port_, "127.0.0.2", 100);
  for (const std::string target : {"/healthz", "/metrics", "/", "/healthz"}) {
    EXPECT_THAT(page(target), StartsWith("HTTP/1.1 200 OK\r\n")) << target;
  }
}

TEST_F(Stranger, CannotPushAVisitorWithTheTokenAside) {
  const std::string token = "0123456789abcdef";
  std::ofstream(path("token")) << token;
  std::filesystem::permissions(path("token"), std::filesystem::perms::owner_read);
  start_with_page({"--page-token-file", "token"});
  RawClient visitor(port_);
  const auto ask = [&] {
    visitor.send("GET /metrics HTTP/1.1\r\nHost: a\r\nauthorization: bearer " + token + "\r\n\r\n");
    return visitor.answer();
  };
  EXPECT_THAT(ask(), StartsWith("HTTP/1.1 200 OK\r\n"));
  const auto others = crowd(port_, "127.0.0.1", 100);
  EXPECT_THAT(page("/metrics"), StartsWith("HTTP/1.1 401"));
  EXPECT_THAT(ask(), StartsWith("HTTP/1.1 200 OK\r\n"));
  EXPECT_THAT(page("/healthz"), StartsWith("HTTP/1.1 200 OK\r\n"));
}

std::string rows(int count) {
  return "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n LIMIT " +
         std::to_string(count) + ") ";
}

// 1,200 bytes a row, 84 MB together: more than an answer may have.
TEST_F(Stranger, MaySortMoreThanAnAnswerMayHave) {
  start_coordinator();
  const std::string sorted =
      rows(70'000) + "SELECT count(*) AS n FROM (SELECT DISTINCT printf('%01200d', i) FROM n)";
  EXPECT_EQ(remote({"query", "hardy2013", sorted, "--format", "csv"}), 0) << errors();
  EXPECT_EQ(output(), "n\r\n70000\r\n");
}

TEST_F(Stranger, IsToldWhichLimitAQuestionExceeds) {
  start_coordinator();
  EXPECT_EQ(remote({"query", "hardy2013", rows(1'000'000'000) + "SELECT max(i) FROM n", "--timeout",
                    "0.1"}),
            1);
  EXPECT_EQ(errors(),
            "proofmass: error: timeout = 0.1 (the query did not end in so many seconds)\n");
  EXPECT_EQ(remote({"query", "hardy2013", "SELECT zeroblob(70000000)"}), 2);
  EXPECT_THAT(errors(), HasSubstr("string or blob too big"));
}

// With less than the 4 GiB of a question to a coordinator.
TEST_F(Stranger, IsToldThatWhatIsSortedIsPartOfTheMemory) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers need more address space than any limit";
#endif
  start_coordinator();
  const std::string shell =
      "ulimit -v 300000; exec " + programs + "/proofmass query " + "served/hardy2013.db \"$1\"";
  Process query(directory / "", "command", "/bin/sh",
                {"-c", shell, "sh",
                 rows(300'000) + "SELECT count(*) FROM (SELECT DISTINCT printf('%01200d', i) "
                                 "FROM n)"});
  EXPECT_EQ(query.wait(), 1);
  EXPECT_EQ(errors(),
            "proofmass: error: memory = 292 MiB (the query and what it sorts need more; ask for "
            "less, or query a copy of the database elsewhere)\n");
}

TEST_F(Stranger, CannotNameACampaignAsAnOptionOrADirectory) {
  start_coordinator();
  for (const std::string name : {"..", ".answers", "-rf", "--help", "_a"}) {
    EXPECT_EQ(remote({"submit", "short.toml", "--name=" + name}), 2);
    EXPECT_THAT(errors(), HasSubstr("campaign.name = \"" + name +
                                    "\" (must be 1 to 64 of "
                                    "[A-Za-z0-9._-], a letter or digit first)"));
    std::ofstream(path("bad.toml")) << "[campaign]\nname = \"" << name << "\"\n";
    EXPECT_EQ(command({"run", "bad.toml", "--db", "bad.db"}), 2);
    EXPECT_THAT(errors(), StartsWith("proofmass: error: bad.toml:2: campaign.name = "));
    EXPECT_EQ(command({"fetch", "--connect", "ipc://nowhere", "--", name}), 2);
    EXPECT_THAT(errors(), HasSubstr("campaign = \"" + name + "\" (must be 1 to 128 of "));
    EXPECT_FALSE(std::filesystem::exists(path("bad.db")));
  }
}

TEST_F(Stranger, HasNoFileWithoutAnEndRead) {
  for (const std::string file : {"/proc/kmsg", "/dev/zero", "/proc/self/environ", "."}) {
    std::ofstream(path("bad.toml"))
        << "[campaign]\nname = \"a\"\n[environment]\nkind = \"file\"\nfile = \"" << file << "\"\n";
    EXPECT_EQ(command({"check", "bad.toml"}), 2) << file;
    EXPECT_THAT(errors(), StartsWith("proofmass: error: ")) << file;
    EXPECT_EQ(command({"check", file}), 2) << file;
    EXPECT_EQ(command({"report", "no.db", "--requirements", file}), 2) << file;
  }
  ASSERT_EQ(mkfifo(path("pipe").c_str(), 0600), 0);
  EXPECT_EQ(command({"check", "pipe"}), 2);
}

TEST_F(Stranger, LearnsNoPathOfTheServer) {
  start_with_page();
  std::ofstream(path("served/notes.db")) << "Notes.\n";
  wait_until("look at the file", [&] { return log_has("campaign_not_served"); });
  EXPECT_TRUE(log_has("served/notes.db (is not an SQLite database)"));
  ASSERT_EQ(remote({"status"}), 0);
  EXPECT_THAT(output(), HasSubstr("notes.db"));
  EXPECT_THAT(output(), Not(HasSubstr("/notes.db")));
  const std::string overview = page("/");
  EXPECT_THAT(overview, HasSubstr("campaign database = notes.db (is not an SQLite database)"));
  EXPECT_THAT(overview, Not(HasSubstr("served/")));
  std::filesystem::rename(path("served/hardy2013.db"), path("served/moved"));
  std::filesystem::create_directory(path("served/hardy2013.db"));
  for (const std::string command : {"report", "fetch"}) {
    EXPECT_EQ(remote({command, "hardy2013"}), 1);
    EXPECT_THAT(errors(), Not(HasSubstr((directory / "").string()))) << command;
    EXPECT_THAT(errors(), Not(HasSubstr("served/"))) << command;
  }
}

}  // namespace
}  // namespace proofmass::test
