#include "proto/link/start_program.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <unistd.h>

#include <algorithm>
#include <system_error>

#include "core/error.hpp"

extern char** environ;

namespace proofmass::wire {
namespace {

/// As posix_spawn() takes them; it does not write to them.
std::vector<char*> pointers_to(const std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  pointers.reserve(texts.size() + 1);
  for (const std::string& text : texts) pointers.push_back(const_cast<char*>(text.c_str()));
  pointers.push_back(nullptr);
  return pointers;
}

}  // namespace

pid_t start_program(const ProgramStart& start) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  int number = 0;
  for (const int descriptor : start.descriptors) {
    posix_spawn_file_actions_adddup2(&actions, descriptor, number++);
  }
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none;
  sigemptyset(&none);
  posix_spawnattr_setsigmask(&attributes, &none);
  sigset_t defaulted = none;
  sigaddset(&defaulted, SIGPIPE);
  posix_spawnattr_setsigdefault(&attributes, &defaulted);
  const int group = start.has_own_group ? POSIX_SPAWN_SETPGROUP : 0;
  posix_spawnattr_setflags(
      &attributes, static_cast<short>(POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | group));
  const std::vector<char*> arguments = pointers_to(start.arguments);
  std::vector<char*> environment;
  if (start.environment) environment = pointers_to(*start.environment);
  pid_t process_id = 0;
  const int error =
      posix_spawnp(&process_id, arguments.front(), &actions, &attributes, arguments.data(),
                   start.environment ? environment.data() : environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  if (error == 0) return process_id;
  throw Error(fmt::format("{}: cannot be started: {}", start.arguments.front(),
                          std::generic_category().message(error)));
}

std::vector<std::string> environment_without_settings() {
  std::vector<std::string> variables;
  for (char** variable = environ; *variable != nullptr; ++variable) {
    const std::string_view text = *variable;
    const bool is_setting = text.starts_with("PROOFMASS_") || text.starts_with("NOTIFY_SOCKET=") ||
                            text.starts_with("SLURM_JOB_END_TIME=");
    if (!is_setting) variables.emplace_back(text);
  }
  return variables;
}

std::filesystem::path program_beside_this(std::string_view name) {
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  std::filesystem::path program = self.parent_path() / name;
  if (!error && access(program.c_str(), X_OK) == 0) return program;
  throw Error(
      fmt::format("program = {} (must be beside {})", program.string(), self.filename().string()));
}

std::string shell_word(std::string_view text) {
  const auto is_plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' ||
           c == '_' || c == '/' || c == '-' || c == '+';
  };
  if (!text.empty() && std::ranges::all_of(text, is_plain) && text[0] != '-') {
    return std::string(text);
  }
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? "'\\''" : std::string(1, c);
  return word + "'";
}

}  // namespace proofmass::wire
