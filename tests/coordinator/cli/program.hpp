#pragma once

#include "coordinator/cli/program.hpp"
#include "tests/test.hpp"

namespace proofmass::test {

/// What `proofmass` printed, and how it ended.
struct Answer {
  int exit_code = -1;
  std::string output;
  std::string error;  ///< Without `proofmass: error: ` and the end of the last line.
};

/// Of `proofmass` with these arguments, in this process.
inline Answer answer_of(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "proofmass");
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  Answer answer{.exit_code = coordinator::run_proofmass(static_cast<int>(argv.size()), argv.data()),
                .output = {},
                .error = {}};
  answer.output = testing::internal::GetCapturedStdout();
  answer.error = testing::internal::GetCapturedStderr();
  const std::string name = "proofmass: error: ";
  if (answer.error.starts_with(name)) answer.error.erase(0, name.size());
  if (answer.error.ends_with('\n')) answer.error.pop_back();
  return answer;
}

}  // namespace proofmass::test
