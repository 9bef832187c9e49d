#include "tests/system/fault_fixture.hpp"

#include <algorithm>
#include <csignal>
#include <exception>
#include <fstream>
#include <regex>
#include <sstream>

#include "coordinator/report/digest.hpp"
#include "coordinator/store/store.hpp"

namespace proofmass::test {

void FaultTest::SetUp() {
  CampaignProcess::SetUp();
  write_null_campaign(4000);
  workers_endpoint = "ipc://" + path("workers").string();
  clients_endpoint = "ipc://" + path("clients").string();
}

void FaultTest::write_null_campaign(std::size_t count) {
  num_null_runs = count;
  write_campaign("null", count);
}

void FaultTest::extend_null_campaign(std::size_t count, const Arguments& further) {
  write_null_campaign(count);
  Arguments command{"submit", "null.toml"};
  command.insert(command.end(), further.begin(), further.end());
  (void)told(command);
}

void FaultTest::write_campaign(const std::string& name, std::size_t count) const {
  std::string text = read_file(path("short.toml"));
  text = std::regex_replace(text, std::regex("\nname = \"[^\"]*\""), "\nname = \"" + name + "\"",
                            std::regex_constants::format_first_only);
  text =
      std::regex_replace(text, std::regex("\nruns = [0-9]+"), "\nruns = " + std::to_string(count));
  std::ofstream(path(name + ".toml")) << text;
}

Process FaultTest::start_behind(const Arguments& prefix, const std::string& name,
                                const std::string& program, const Arguments& arguments) const {
  Arguments words = prefix;
  words.push_back(programs + "/" + program);
  words.insert(words.end(), arguments.begin(), arguments.end());
  return Process(directory / "", name, "/usr/bin/env", words);
}

Process FaultTest::coordinator(const std::string& name, const Arguments& further,
                               const Arguments& prefix) const {
  Arguments arguments{"--directory",    served,           "--bind",
                      workers_endpoint, "--bind-clients", clients_endpoint};
  arguments.insert(arguments.end(), further.begin(), further.end());
  return start_behind(prefix, name, "proofmass-coordinator", arguments);
}

Process FaultTest::worker(const std::string& name, const Arguments& further,
                          const Arguments& prefix) const {
  Arguments arguments{"--connect", workers_endpoint, "--name", name, "--threads", "1"};
  arguments.insert(arguments.end(), further.begin(), further.end());
  return start_behind(prefix, name, "proofmass-worker", arguments);
}

Process FaultTest::null_worker(const std::string& name, const Arguments& further,
                               const Arguments& prefix) const {
  Arguments arguments{"--connect", workers_endpoint, "--name", name, "--threads", "1"};
  arguments.insert(arguments.end(), further.begin(), further.end());
  if (std::find(further.begin(), further.end(), "--run-time") == further.end()) {
    arguments.insert(arguments.end(), {"--run-time", "0.05"});
  }
  return start_behind(prefix, name, "proofmass-null-worker", arguments);
}

std::string FaultTest::told(const Arguments& command) const {
  Arguments arguments = command;
  arguments.insert(arguments.end(), {"--connect", clients_endpoint});
  Process client = start_behind({}, "client", "proofmass", arguments);
  EXPECT_EQ(client.wait(), 0) << errors_of("client");
  return read_file(path("client.out"));
}

nlohmann::json FaultTest::status_of(const std::string& campaign) const {
  const nlohmann::json status = nlohmann::json::parse(told({"status", "--json"}));
  for (const nlohmann::json& one : status.at("campaigns")) {
    if (one.at("name") == campaign) return one;
  }
  return {};
}

void FaultTest::wait_for_log(const std::string& name, const std::string& text) const {
  try {
    wait_until(text + " in the log of " + name, [&] { return contains(errors_of(name), text); });
  } catch (const std::exception&) {
    ADD_FAILURE() << errors_of(name);
    throw;
  }
}

std::size_t FaultTest::num_log_lines(const std::string& name, const std::string& text) const {
  std::istringstream log(errors_of(name));
  std::size_t count = 0;
  for (std::string line; std::getline(log, line);) {
    if (contains(line, text)) ++count;
  }
  return count;
}

std::filesystem::path FaultTest::file_of(const std::string& campaign) const {
  return path(served + "/" + campaign + ".db");
}

std::size_t FaultTest::num_done(const std::string& campaign) const {
  const std::string count = stored_text(file_of(campaign), "SELECT count(*) FROM run_result");
  return count.empty() ? 0 : std::stoul(count);
}

void FaultTest::wait_for_done(const std::string& campaign, std::size_t count) const {
  wait_until("stored runs", [&] { return num_done(campaign) >= count; });
}

void FaultTest::end_when_done(Process& coordinator, const std::string& name,
                              std::size_t num_registered) {
  wait_until("registered workers",
             [&] { return num_log_lines(name, "worker_registered") >= num_registered; });
  wait_for_done("null", num_null_runs);
  coordinator.signal(SIGTERM);
  EXPECT_EQ(coordinator.wait(), 0) << errors_of(name);
}

std::string FaultTest::digest(const std::string& campaign) const {
  return proofmass::coordinator::digest_of(
      proofmass::coordinator::Store::open_read_only(file_of(campaign)));
}

std::string FaultTest::undisturbed_digest(const std::string& campaign) const {
  const std::string endpoint = "ipc://" + path("undisturbed.socket").string();
  const std::string program = campaign == "null" ? "proofmass-null-worker" : "proofmass-worker";
  Process coordinator =
      start_behind({}, "undisturbed", "proofmass-coordinator",
                   {campaign == "null" ? "null.toml" : "short.toml", "--directory", "undisturbed",
                    "--bind", endpoint, "--exit-when-done"});
  Process worker =
      start_behind({}, "undisturbed-worker", program, {"--connect", endpoint, "--threads", "2"});
  EXPECT_EQ(coordinator.wait(), 0) << errors_of("undisturbed");
  EXPECT_EQ(worker.wait(), 0) << errors_of("undisturbed-worker");
  const auto file = path("undisturbed/" + campaign + ".db");
  const auto store = proofmass::coordinator::Store::open_read_only(file);
  EXPECT_EQ(store.finished_runs().size(), 1U);
  return proofmass::coordinator::digest_of(store);
}

}  // namespace proofmass::test
