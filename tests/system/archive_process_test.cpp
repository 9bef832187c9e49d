// What people do with campaign databases, by real processes: while a coordinator writes, with pipes
// that close, on disks that are full, and interrupted.

#include <gtest/gtest.h>
#include <signal.h>
#include <sqlite3.h>
#include <stdlib.h>
#include <sys/wait.h>

#include <filesystem>
#include <string>

#include "tests/coordinator/archive/damaged_file.hpp"
#include "tests/system/campaign_process.hpp"

namespace proofmass::test {
namespace {

class ArchiveProcess : public CampaignProcess {
 protected:
  void SetUp() override {
    CampaignProcess::SetUp();
    ASSERT_EQ(start("done", {"--workers", "2", "--runs", "32"}).wait(), 0) << errors_of("done");
  }

  [[nodiscard]] Process proofmass(const std::string& name, const Arguments& arguments) const {
    return Process(directory / "", name, programs + "/proofmass", arguments);
  }
  [[nodiscard]] std::string output_of(const std::string& name) const {
    return read_file(path(name + ".out"));
  }
  /// Exit code of a line of shell in the directory.
  [[nodiscard]] int shell(const std::string& line) const {
    const std::string command = "cd '" + (directory / "").string() + "' && bash -c '" + line + "'";
    return WEXITSTATUS(::system(command.c_str()));
  }
  void change(const std::string& name, const std::string& sql) const {
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open(path(name).c_str(), &database), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK);
    sqlite3_close(database);
  }
};

// Another process, with another thread count than the workers, computes the same bits.
TEST_F(ArchiveProcess, VerifiesWhatWorkersComputedAndABackupOfIt) {
  EXPECT_EQ(proofmass("verify", {"verify", "done.db", "--fraction", "1"}).wait(), 0);
  EXPECT_TRUE(contains(output_of("verify"), "32 of 32 runs simulated again"))
      << output_of("verify");
  EXPECT_EQ(proofmass("backup", {"backup", "done.db", "copy.db"}).wait(), 0);
  EXPECT_EQ(stored_runs(path("copy.db")), stored_runs(path("done.db")));
  change("copy.db", "UPDATE run_result SET num_rounds = num_rounds + 1 WHERE run_index = 20");
  EXPECT_EQ(proofmass("again", {"verify", "copy.db", "--fraction", "1"}).wait(), 1);
  EXPECT_TRUE(contains(output_of("again"), "run 20: num_rounds\n")) << output_of("again");
  EXPECT_TRUE(contains(errors_of("again"), "copy.db: 2 of 11 checks fail")) << errors_of("again");
}

TEST_F(ArchiveProcess, WorksOnAFileThatIsBeingServed) {
  Process run = start("served", {"--workers", "2"});
  wait_for_runs("served", 2);
  EXPECT_EQ(proofmass("verify", {"verify", "served.db"}).wait(), 0) << output_of("verify");
  EXPECT_EQ(proofmass("backup", {"backup", "served.db", "copy.db"}).wait(), 0);
  EXPECT_EQ(proofmass("tag", {"tag", "served.db", "add", "thesis"}).wait(), 0) << errors_of("tag");
  EXPECT_EQ(proofmass("note", {"note", "served.db", "while it ran"}).wait(), 0);
  EXPECT_EQ(proofmass("export", {"export", "served.db"}).wait(), 0);
  EXPECT_EQ(run.wait(), 0) << errors_of("served");
  EXPECT_EQ(stored_runs(path("served.db")), reference());
  const auto of_copy = stored_runs(path("copy.db"));
  EXPECT_GE(of_copy.size(), 2U);
  for (const auto& [index, stored] : of_copy) EXPECT_EQ(stored, reference().at(index));
}

// Whatever a file holds, no command ends by a signal: rows out of order reached an assertion.
TEST_F(ArchiveProcess, RefusesAFileWhoseRowsAreOutOfOrder) {
  for (const std::string table : {"run_result", "delivery"}) {
    ASSERT_EQ(start(table, {"--workers", "1", "--runs", "12"}).wait(), 0) << errors_of(table);
    const std::string file = table + ".db";
    swap_keys(path(file), table, 3, 7);
    const bool has_results = table == "delivery";
    EXPECT_EQ(proofmass("verify", {"verify", file}).wait(), 1) << output_of("verify");
    EXPECT_TRUE(contains(output_of("verify"), "is damaged: "));
    EXPECT_EQ(proofmass("again", {"verify", file, "--fraction", "1"}).wait(), 1);
    EXPECT_EQ(proofmass("report", {"report", file}).wait(), 1);
    EXPECT_EQ(proofmass("export", {"export", file}).wait(), has_results ? 0 : 1);
    EXPECT_EQ(proofmass("compare", {"compare", file, "done.db"}).wait(), has_results ? 0 : 1);
    EXPECT_EQ(proofmass("sensitivity", {"sensitivity", file}).wait(), 1) << "or too few runs";
    EXPECT_EQ(proofmass("list", {"list", file}).wait(), 0);
    EXPECT_EQ(start(table, {"--workers", "1", "--runs", "12"}).wait(), 1) << errors_of(table);
    EXPECT_TRUE(contains(errors_of(table), "is damaged: ")) << errors_of(table);
  }
}

// One bit of a number: its text would be another one, with nothing to show for it.
TEST_F(ArchiveProcess, RefusesToPrintNumbersThatWereChanged) {
  const std::string sql =
      "UPDATE run_result SET estimate_k2d_s2_m = estimate_k2d_s2_m * 1.01 WHERE run_index = 20";
  change("done.db", sql);
  for (const std::string command :
       {"report done.db", "export done.db", "sensitivity done.db", "compare done.db done.db"}) {
    EXPECT_EQ(shell(programs + "/proofmass " + command + " > /dev/null 2> changed.err"), 1)
        << command;
    EXPECT_TRUE(
        contains(read_file(path("changed.err")), "is damaged: the digest of its 32 results"))
        << command << read_file(path("changed.err"));
  }
}

TEST_F(ArchiveProcess, SaysThatAPipeIsClosedOrADiskIsFull) {
  const std::string program = programs + "/proofmass";
  EXPECT_EQ(shell("exec 3> >(exit); wait $!; " + program + " export done.db >&3 2> pipe.err"), 1);
  EXPECT_EQ(read_file(path("pipe.err")),
            "proofmass: error: output = - (cannot be written: Broken pipe)\n");
  EXPECT_EQ(shell(program + " export done.db --format json > /dev/full 2> full.err"), 1);
  EXPECT_EQ(read_file(path("full.err")),
            "proofmass: error: output = - (cannot be written: No space left on device)\n");
}

TEST_F(ArchiveProcess, SaysThatItsAnswerIsLost) {
  for (const std::string command :
       {"report done.db", "verify done.db", "compare done.db done.db", "list", "list --json",
        "tag done.db", "note done.db", "--help", "--version"}) {
    if (command.starts_with("tag")) change("done.db", "INSERT INTO tag (tag) VALUES (1)");
    if (command.starts_with("note")) change("done.db", "INSERT INTO note (text) VALUES (1)");
    EXPECT_EQ(shell(programs + "/proofmass " + command + " > /dev/full 2> full.err"), 1) << command;
    EXPECT_TRUE(read_file(path("full.err")).starts_with("proofmass: error: standard output: "))
        << command << ": " << read_file(path("full.err"));
  }
}

TEST_F(ArchiveProcess, NeedsNobodyToHearItsMessages) {
  const std::string program = programs + "/proofmass ";
  for (const std::string command : {"report done.db", "verify done.db", "list", "--help"}) {
    EXPECT_EQ(shell(program + command + " > /dev/full 2>&1"), 1) << command;
  }
  EXPECT_EQ(shell(program + "query done.db selec 2> /dev/full"), 2);
  EXPECT_EQ(shell(programs + "/proofmass-worker --threads 0 2> /dev/full"), 2);
  EXPECT_EQ(shell(program + "run short.toml --db silent.db > /dev/null 2> /dev/full"), 0);
  EXPECT_EQ(stored_runs(path("silent.db")), reference());
}

TEST_F(ArchiveProcess, EndsInOrderWhenItIsInterrupted) {
  // Sessions so long that their simulation is not over before the signal comes.
  change("done.db",
         "UPDATE campaign SET definition = replace(definition, 'orbits = 2', "
         "'orbits = 200')");
  Process verify = proofmass("verify", {"verify", "done.db", "--fraction", "1"});
  wait_until("the simulation", [&] { return contains(output_of("verify"), "digest "); });
  verify.signal(SIGINT);
  EXPECT_EQ(verify.wait(), 130);
  EXPECT_EQ(errors_of("verify"), "proofmass: interrupted\n");
}

// The signal comes early in the 140 orbits of a run, of which 2 GB would be written.
TEST_F(ArchiveProcess, AReplayThatIsInterruptedWritesNothing) {
  ASSERT_EQ(proofmass("part", {"run", "paper.toml", "--db", "part.db", "--runs", "1"}).wait(), 0);
  for (const std::string format : {"hdf5", "csv"}) {
    Process replay = proofmass(format, {"replay", "part.db", "--run", "0", "--format", format,
                                        "--output", "out." + format});
    const auto begins = [&] {
      const std::filesystem::path place = format == "csv" ? path("out.csv") : directory / "";
      if (!std::filesystem::exists(place)) return false;
      for (const auto& entry : std::filesystem::directory_iterator(place)) {
        if (contains(entry.path(), ".new") && entry.file_size() > 1'000'000) return true;
      }
      return false;
    };
    wait_until("samples of " + format, begins);
    replay.signal(SIGINT);
    EXPECT_EQ(replay.wait(), 130) << errors_of(format);
    EXPECT_EQ(errors_of(format), "proofmass: interrupted\n");
    EXPECT_FALSE(std::filesystem::exists(path("out." + format)));
  }
  EXPECT_EQ(shell("ls | grep -c new"), 1);
}

TEST_F(ArchiveProcess, AMergeThatIsInterruptedWritesNoDatabase) {
  // Its sessions are so long that their simulation is not over before the signal comes.
  ASSERT_EQ(proofmass("part", {"run", "paper.toml", "--db", "part.db", "--runs", "16"}).wait(), 0);
  Process merge = proofmass("merge", {"merge", "whole.db", "part.db", "--fraction", "1"});
  const std::string status = "/proc/" + std::to_string(merge.id()) + "/status";
  // Bit 1 of the mask is that of SIGINT.
  const auto catches_interrupts = [&] {
    const std::string text = read_file(status);
    const std::size_t mask = text.find("SigCgt:\t");
    return mask != std::string::npos && (std::stoull(text.substr(mask + 8), nullptr, 16) & 2) != 0;
  };
  wait_until("a handler", catches_interrupts);
  merge.signal(SIGINT);
  EXPECT_EQ(merge.wait(), 130);
  EXPECT_EQ(errors_of("merge"), "proofmass: interrupted\n");
  EXPECT_FALSE(std::filesystem::exists(path("whole.db")));
}

TEST_F(ArchiveProcess, ComparesAndListsCampaigns) {
  EXPECT_EQ(start("other", {"--seed", "2", "--runs", "16"}).wait(), 0);
  EXPECT_EQ(proofmass("compare", {"compare", "done.db", "other.db"}).wait(), 0);
  EXPECT_TRUE(contains(output_of("compare"), "as the seeds differ: 32 runs of A, 16 of B."))
      << output_of("compare");
  EXPECT_EQ(proofmass("list", {"list", "--json", "."}).wait(), 0);
  EXPECT_TRUE(contains(output_of("list"), "\"./other.db\"")) << output_of("list");
}

TEST_F(ArchiveProcess, RefusesWhatMakesNoSense) {
  EXPECT_EQ(proofmass("fraction", {"verify", "done.db", "--fraction", "2"}).wait(), 2);
  EXPECT_EQ(proofmass("format", {"export", "done.db", "--format", "xml"}).wait(), 2);
  EXPECT_EQ(proofmass("hdf5", {"export", "done.db", "--format", "hdf5"}).wait(), 2);
  EXPECT_EQ(proofmass("extra", {"report", "done.db", "--all"}).wait(), 2);
  EXPECT_EQ(errors_of("extra"),
            "proofmass: error: option = --all (must be one that --help lists)\n");
  EXPECT_EQ(proofmass("config", {"--config", "none.toml", "list"}).wait(), 2);
  EXPECT_EQ(errors_of("config"), "proofmass: error: config = none.toml (cannot be read)\n");
  std::ofstream(path("options.toml")) << "[query]\nrows = 3\n";
  EXPECT_EQ(proofmass("option", {"--config", "options.toml", "list"}).wait(), 2);
  EXPECT_EQ(errors_of("option"),
            "proofmass: error: config = options.toml:2 (query.rows is no option)\n");
  EXPECT_EQ(proofmass("none", {"verify", "none.db"}).wait(), 1);
  EXPECT_EQ(errors_of("none"), "proofmass: error: campaign database = none.db (does not exist)\n");
  EXPECT_EQ(proofmass("foreign", {"list", "short.toml"}).wait(), 1);
  EXPECT_EQ(errors_of("foreign"),
            "proofmass: error: campaign database = short.toml (is not a Proofmass campaign)\n");
}

}  // namespace
}  // namespace proofmass::test
