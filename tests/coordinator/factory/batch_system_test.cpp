#include "coordinator/factory/factory.hpp"
#include "core/error.hpp"
#include "proto/link/machine.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

const BatchSystem& system_of(std::string_view name) {
  return *std::ranges::find(batch_systems(), name, &BatchSystem::name);
}

FactoryConfig example() {
  return {.name = "fleet",
          .queue_name = "fleet-1a2b3",
          .walltime = std::chrono::seconds(2 * 3600 + 5 * 60 + 7),
          .worker_endpoint = "tcp://head:2",
          .worker_command = "echo \"it's $1\""};
}

/// What the shell makes of the text again.
std::string read_by_shell(const std::string& word) {
  return output_of({{"sh", "-c", "printf %s " + word}});
}

std::vector<std::string> ids_and_states(const std::vector<Allocation>& allocations) {
  std::vector<std::string> texts;
  for (const Allocation& allocation : allocations) {
    texts.push_back(allocation.id + (allocation.is_running ? " runs" : " waits"));
  }
  return texts;
}

TEST(BatchSystem, QuotesForTheShell) {
  for (const std::string text :
       {"", "a b", "it's", "$HOME `id` \"x\" \\", "'", "-rf", "~", "a/b.db"}) {
    EXPECT_EQ(read_by_shell(wire::shell_word(text)), text);
  }
  EXPECT_EQ(wire::shell_word("campaigns/a-b_1.db"), "campaigns/a-b_1.db");
  EXPECT_EQ(wire::shell_word("it's"), "'it'\\''s'");
}

// The script of Slurm and PBS, with the variable that they set.
TEST(BatchSystem, HandsTheIdentifierToTheWorkersCommand) {
  for (const auto& [name, variable] : {std::pair("slurm", "SLURM_JOB_ID"), {"pbs", "PBS_JOBID"}}) {
    const BatchCommand command = system_of(name).submission(example());
    EXPECT_THAT(command.input, StartsWith("#!/bin/bash\n"));
    EXPECT_EQ(output_of({{"env", std::string(variable) + "=17.host", "bash"}, command.input}),
              "it's 17.host\n");
  }
}

TEST(BatchSystem, AsksSlurmForAMachineOrForProcessors) {
  FactoryConfig config = example();
  config.submit_options = {"--partition=long"};
  EXPECT_THAT(system_of("slurm").submission(config).arguments,
              ElementsAre("sbatch", "--parsable", "--job-name=fleet-1a2b3", "--nodes=1",
                          "--ntasks=1", "--time=2:05:07", "--exclusive", "--partition=long"));
  config.num_processors = 12;
  EXPECT_THAT(system_of("slurm").submission(config).arguments,
              AllOf(Contains("--cpus-per-task=12"), Not(Contains("--exclusive"))));
}

TEST(BatchSystem, ReadsWhatSlurmAnswers) {
  const BatchSystem& slurm = system_of("slurm");
  EXPECT_EQ(id_in("4711\n", "sbatch"), "4711");
  EXPECT_EQ(id_in("4711;cluster\n", "sbatch"), "4711");
  EXPECT_THAT(ids_and_states(allocations_of(
                  slurm, example(), "17 PENDING\n18 RUNNING\n19 CONFIGURING\n20 SUSPENDED\n")),
              ElementsAre("17 waits", "18 runs", "19 waits", "20 waits"));
  EXPECT_THAT(allocations_of(slurm, example(), ""), IsEmpty());
  EXPECT_THAT(slurm.canceller, ElementsAre("scancel"));
}

TEST(BatchSystem, AsksPbsForAMachineOrForProcessors) {
  FactoryConfig config = example();
  EXPECT_THAT(system_of("pbs").submission(config).arguments,
              ElementsAre("qsub", "-N", "fleet-1a2b3", "-l", "walltime=2:05:07", "-l", "select=1",
                          "-l", "place=excl"));
  config.num_processors = 12;
  EXPECT_THAT(system_of("pbs").submission(config).arguments,
              AllOf(Contains("select=1:ncpus=12"), Not(Contains("place=excl"))));
}

TEST(BatchSystem, ReadsWhatPbsAnswers) {
  const BatchSystem& pbs = system_of("pbs");
  EXPECT_EQ(id_in("17.head\n", "qsub"), "17.head");
  EXPECT_THAT(ids_and_states(allocations_of(pbs, example(), "18.head Q\n17.head R\n")),
              ElementsAre("18.head waits", "17.head runs"));
}

/// A `qselect` that knows an allocation of each state, called as its state.
std::string folder_of_qselect() {
  std::string folder = testing::TempDir() + "/qselect-of-test";
  std::filesystem::create_directories(folder);
  const std::string file = folder + "/qselect";
  std::ofstream(file) << "#!/bin/sh\n"
                         "[ \"$1 $3 $4 $5\" = '-u -N fleet-1a2b3 -s' ] || exit 2\n"
                         "for state in B E F H M Q R S T U W X; do\n"
                         "  case $6 in *$state*) echo $state.head ;; esac\n"
                         "done\n";
  std::filesystem::permissions(file, std::filesystem::perms::owner_all);
  return folder;
}

// B, E, F, M and X: arrays, and those that are about to end, have ended or were moved away.
TEST(BatchSystem, ListsWhatPbsHasNotEnded) {
  const BatchSystem& pbs = system_of("pbs");
  BatchCommand listing = pbs.listing(example());
  listing.arguments.insert(listing.arguments.begin(),
                           {"env", "PATH=" + folder_of_qselect() + ":/usr/bin:/bin"});
  EXPECT_THAT(ids_and_states(allocations_of(pbs, example(), output_of(listing))),
              ElementsAre("H.head waits", "Q.head waits", "S.head waits", "T.head waits",
                          "U.head waits", "W.head waits", "R.head runs"));
}

// The constraint is also an expression of awk. States: 1 idle, 2 running, 3 removed, 4 completed,
// 5 held, 6 transferring output, 7 suspended.
TEST(BatchSystem, ListsWhatCondorHasNotEnded) {
  const BatchCommand listing = system_of("condor").listing(example());
  ASSERT_EQ(listing.arguments.at(1), "-constraint");
  const auto listed = [&](const std::string& name) {
    return output_of({{"awk", "BEGIN { JobBatchName = \"" + name +
                                  "\"; for (JobStatus = 1; JobStatus <= 7; ++JobStatus) if (" +
                                  listing.arguments.at(2) + ") print JobStatus }"}});
  };
  EXPECT_EQ(listed("fleet-1a2b3"), "1\n2\n5\n7\n");
  EXPECT_EQ(listed("fleet"), "");
}

// What HTCondor does with `arguments` in its new syntax: the outer double quotes go, two double
// quotes are one, single quotes keep a word together, and two of them within are one. Before that,
// it expands macros, among them those for a dollar sign and for two.
TEST(BatchSystem, QuotesForCondor) {
  const BatchCommand command = system_of("condor").submission(example());
  EXPECT_THAT(command.input, HasSubstr("arguments = \"-c 'echo \"\"it''s $(DOLLAR)1\"\"' bash "
                                       "$(ClusterId).$(ProcId)\"\n"));
  EXPECT_THAT(command.input, EndsWith("queue\n"));
}

TEST(BatchSystem, LetsCondorExpandNothingOfTheWorkersCommand) {
  FactoryConfig config = example();
  config.worker_command = "cd $(mktemp -d); x=$ENV(HOME) y=$$(Memory) z=$$$";
  EXPECT_THAT(system_of("condor").submission(config).input,
              HasSubstr("'cd $(DOLLAR)(mktemp -d); x=$(DOLLAR)ENV(HOME) "
                        "y=$$(DOLLARDOLLAR)(Memory) z=$$(DOLLARDOLLAR)$(DOLLAR)'"));
}

TEST(BatchSystem, ReadsWhatCondorAnswers) {
  const BatchSystem& condor = system_of("condor");
  EXPECT_EQ(id_in("12.0 - 12.0\n", "condor_submit"), "12.0");
  EXPECT_THAT(ids_and_states(allocations_of(condor, example(), "12.0 1\n13.0 2\n")),
              ElementsAre("12.0 waits", "13.0 runs"));
}

TEST(BatchSystem, FindsLocalWorkersByNameAndProcess) {
  EXPECT_THAT(ids_and_states(allocations_of(
                  system_of("local"), example(),
                  " 17 proofmass-worker --connect tcp://head:2 --name fleet-17 --threads 2\n"
                  " 18 proofmass-worker --connect tcp://head:2 --name fleet-17\n"  // Its second.
                  " 19 proofmass-worker --connect tcp://head:2 --name other-19\n"
                  " 20 proofmass-worker --connect tcp://head:3 --name fleet-20\n"
                  " 21 grep --name\n")),
              ElementsAre("17 runs"));
}

TEST(BatchSystem, StartsLocalWorkersWithTheirProcessAsIdentifierAndALog) {
  FactoryConfig config = example();
  const std::string file = testing::TempDir() + "/started-by-factory";
  config.workers_log = file + ".log";
  std::ofstream(config.workers_log).close();
  std::filesystem::resize_file(config.workers_log, 17 << 20);
  config.worker_command = "source /dev/null; echo here >&2; echo \"$1\" $$ > " +
                          wire::shell_word(file + ".new") + " && mv " +
                          wire::shell_word(file + ".new") + " " + wire::shell_word(file);
  const BatchSystem& local = system_of("local");
  const std::string id = id_in(output_of(local.submission(config)), "sh");
  const std::string seen =
      output_of({{"sh", "-c",
                  "until [ -e \"$0\" ]; do sleep 0.01; done; cat \"$0\" \"$0.log\"; stat -c %s "
                  "\"$0.log.1\"; rm \"$0\"*",
                  file}});
  EXPECT_EQ(seen, id + " " + id + "\nhere\n17825792\n") << "an old log made room";
}

TEST(BatchSystem, RefusesAnswersThatItDoesNotUnderstand) {
  const BatchSystem& slurm = system_of("slurm");
  EXPECT_EQ(
      test::message_of<Error>([&] { (void)id_in("", "sbatch"); }),
      "sbatch: identifier = \"\" (must be 1 to 64 of [A-Za-z0-9._-], a letter or digit first)");
  EXPECT_EQ(test::message_of<Error>([&] { (void)id_in("$(rm)", "sbatch"); }),
            "sbatch: identifier = \"$(rm)\" (must be 1 to 64 of [A-Za-z0-9._-], a letter or digit "
            "first)");
  EXPECT_EQ(test::message_of<Error>([&] { (void)allocations_of(slurm, example(), "17\n"); }),
            "squeue: line = \"17\" (must be an identifier and a state)");
}

TEST(BatchSystem, SaysWhyACommandFailed) {
  EXPECT_EQ(test::message_of<Error>([] {
              (void)output_of({{"sh", "-c", "echo first >&2; echo no such partition >&2; exit 3"}});
            }),
            "sh: exit code 3: no such partition");
  EXPECT_EQ(test::message_of<Error>([] {
              (void)output_of({{"sh", "-c", "kill -9 $$"}});
            }),
            "sh: killed by signal 9 (Killed)");
  EXPECT_EQ(test::message_of<Error>([] { (void)output_of({{"no-such-program"}}); }),
            "no-such-program: cannot be started: No such file or directory");
}

/// A batch system that runs what it is handed: an identifier is a line of sh that cancels it.
class CarryOut : public testing::Test {
 protected:
  void carry_out(const FactoryActions& actions) {
    coordinator::carry_out(actions, state_, system_, config_,
                           [this](const wire::Event& event) { events_.push_back(to_text(event)); });
  }

  BatchSystem system_{.name = "sh",
                      .submission =
                          [](const FactoryConfig& config) {
                            return BatchCommand{{"sh", "-c", config.worker_command}};
                          },
                      .listing = nullptr,
                      .lister = {},
                      .running = {},
                      .canceller = {"sh", "-c"}};
  FactoryConfig config_{.name = "fleet", .worker_command = "printf 17"};
  FactoryState state_;
  std::vector<std::string> events_;
};

TEST_F(CarryOut, GoesOnAfterACancellationThatFails) {
  carry_out({.num_submissions = 1, .cancelled = {"echo Unknown Job Id >&2; exit 153", "true"}});
  EXPECT_THAT(events_, ElementsAre("cancellation_failed allocation=\"echo Unknown Job Id >&2; exit "
                                   "153\" reason=\"sh: exit code 153: Unknown Job Id\"",
                                   "allocation_cancelled allocation=true",
                                   "worker_requested allocation=17"));
  EXPECT_TRUE(state_.allocations.contains("17"));
}

TEST_F(CarryOut, TriesNoFurtherSubmissionAfterOneThatFails) {
  config_.worker_command = "echo queue full >&2; exit 1";
  carry_out({.num_submissions = 3, .cancelled = {}});
  EXPECT_THAT(events_, ElementsAre("submission_failed retry_min=1 "
                                   "reason=\"sh: exit code 1: queue full\""));
  EXPECT_EQ(state_.num_failed_submissions, 1);
}

}  // namespace
}  // namespace proofmass::coordinator
