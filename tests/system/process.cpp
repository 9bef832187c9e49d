#include "tests/system/process.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <thread>

namespace proofmass::test {
namespace {

constexpr std::chrono::minutes patience(2);

/// State letter and parent of a process, from the kernel; empty text if there is none.
std::pair<std::string, pid_t> state_and_parent(pid_t id) {
  // A process that ends meanwhile makes the read fail, which std::getline() does not throw.
  std::ifstream stream(fmt::format("/proc/{}/stat", id));
  std::string text;
  std::getline(stream, text);
  const auto name_end = text.rfind(')');
  if (name_end == std::string::npos) return {"", 0};
  std::istringstream rest(text.substr(name_end + 1));
  std::string state;
  pid_t parent = 0;
  rest >> state >> parent;
  return {state, parent};
}

int open_empty(const std::filesystem::path& file) {
  return open(file.c_str(), O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC, 0600);
}

}  // namespace

std::string read_file(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void wait_until(const std::string& what, const std::function<bool()>& condition) {
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) throw std::runtime_error("never: " + what);
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
}

bool is_alive(pid_t id) {
  const auto [state, parent] = state_and_parent(id);
  return !state.empty() && state != "Z" && state != "X";
}

Process::Process(const std::filesystem::path& directory, const std::string& name,
                 const std::string& program, const std::vector<std::string>& arguments) {
  std::vector<std::string> words{program};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  // Empty before anybody reads: a former process of the same name may have said what is waited for.
  const int output = open_empty(directory / (name + ".out"));
  const int errors = open_empty(directory / (name + ".err"));
  id_ = fork();
  if (id_ != 0) {
    close(output);
    close(errors);
    setpgid(id_, id_);  // In both, so that the group is there whoever comes first.
    return;
  }
  setpgid(0, 0);
  dup2(output, STDOUT_FILENO);
  dup2(errors, STDERR_FILENO);
  setenv("TMPDIR", directory.c_str(), 1);  // What a killed program leaves goes with the test.
  if (chdir(directory.c_str()) == 0) execv(program.c_str(), argv.data());
  _exit(127);
}

Process::~Process() {
  if (has_ended()) return;
  signal_all(SIGKILL);
  waitpid(id_, nullptr, 0);
}

void Process::signal(int number) const { kill(id_, number); }

void Process::signal_all(int number) const { kill(-id_, number); }

bool Process::has_ended() {
  if (!has_ended_) has_ended_ = waitpid(id_, &status_, WNOHANG) == id_;
  return has_ended_;
}

int Process::wait() {
  wait_until("end of the process", [&] { return has_ended(); });
  return WIFEXITED(status_) ? WEXITSTATUS(status_) : -WTERMSIG(status_);
}

std::vector<pid_t> Process::children() const {
  std::vector<pid_t> children;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const std::string name = entry.path().filename();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    const pid_t id = std::stoi(name);
    const auto [state, parent] = state_and_parent(id);
    if (parent == id_ && state != "Z" && state != "X") children.push_back(id);
  }
  return children;
}

}  // namespace proofmass::test
