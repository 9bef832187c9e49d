#include "proto/model_program/program_process.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <optional>
#include <system_error>
#include <utility>

#include "core/error.hpp"
#include "proto/link/machine.hpp"
#include "proto/model_program/json_line.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::wire {
namespace {

/// Two connected sockets, which are closed in programs that are started, but for what they are
/// given.
std::pair<Descriptor, Descriptor> connected_pair() {
  std::array<int, 2> ends{};
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) == 0) {
    return {Descriptor(ends[0]), Descriptor(ends[1])};
  }
  throw ModelProgramError(
      fmt::format("model program: no socket: {}", std::generic_category().message(errno)));
}

/// A pipe: its first end is told what the second one writes, and when that is closed.
std::pair<Descriptor, Descriptor> new_pipe() {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) == 0) return {Descriptor(ends[0]), Descriptor(ends[1])};
  throw ModelProgramError(
      fmt::format("model program: no pipe: {}", std::generic_category().message(errno)));
}

/// Has the kernel kill the group of processes as soon as nobody has the other end of the pipe: it
/// then signals that there is something to read. A parent-death signal (PR_SET_PDEATHSIG) would
/// come when the thread that started the program ends, and other threads go on using it.
void kill_at_end_of(int pipe, pid_t group) {
  fcntl(pipe, F_SETSIG, SIGKILL);
  fcntl(pipe, F_SETOWN, -group);
  fcntl(pipe, F_SETFL, O_ASYNC);
}

constexpr std::size_t first_errors_size_max = 65536;
constexpr std::size_t last_errors_size_max = 4096;

}  // namespace

ProgramProcess::ProgramProcess(const std::filesystem::path& program, const ProgramLimits& limits)
    : name_(program.string()) {
  auto [questions, its_input] = connected_pair();
  auto [answers, its_output] = connected_pair();
  auto [errors, its_errors] = new_pipe();
  auto [its_lifeline, lifeline] = new_pipe();
  try {
    process_id_ = start_program({.arguments = {name_},
                                 .descriptors = {its_input.number(), its_output.number(),
                                                 its_errors.number(), its_lifeline.number()},
                                 .environment = environment_without_settings(),
                                 .has_own_group = true});
  } catch (const Error& error) {
    const std::string_view what = error.what();
    const bool is_no_program = what.ends_with(std::generic_category().message(ENOEXEC));
    throw ModelProgramError(
        fmt::format("model program = {}{}", what,
                    is_no_program ? "; a script begins with #! and what runs it" : ""));
  }
  kill_at_end_of(its_lifeline.number(), process_id_);
  questions_ = std::move(questions);
  answers_ = std::move(answers);
  errors_ = std::move(errors);
  lifeline_ = std::move(lifeline);
  fcntl(errors_.number(), F_SETFL, O_NONBLOCK);
  answer_time_max_ = std::chrono::seconds(limits.answer_time_max_s);
  limit_memory(limits, false);
}

void ProgramProcess::limit(const ProgramLimits& limits) {
  answer_time_max_ = std::chrono::seconds(limits.answer_time_max_s);
  limit_memory(limits, true);
}

void ProgramProcess::limit_memory(const ProgramLimits& limits, bool is_final) const {
  rlimit memory{};
  prlimit(process_id_, RLIMIT_DATA, nullptr, &memory);
  memory.rlim_cur = std::min(memory.rlim_max, rlim_t{limits.memory_max_mib} << 20);
  if (is_final) memory.rlim_max = memory.rlim_cur;
  prlimit(process_id_, RLIMIT_DATA, &memory, nullptr);
}

ProgramProcess::~ProgramProcess() {
  if (process_id_ != 0) {
    kill(process_id_, SIGKILL);
    (void)wait_for_end(process_id_);
  }
  pass_on_errors();
  const std::size_t shown = first_errors_size_max + last_errors_.size();
  if (errors_size_ > shown) {
    say(fmt::format("\n{}: {} bytes of its standard error are left out here\n", name_,
                    errors_size_ - shown));
  }
  say_on(stderr, last_errors_);
}

std::string ProgramProcess::how_it_ended() {
  // It has closed its output, which it does just before it ends unless it means to stay.
  const std::optional<int> status =
      status_at_end(process_id_, [num_left = 100]() mutable { return num_left-- > 0; });
  process_id_ = 0;
  return status ? end_text(*status) : "it closed its output";
}

void ProgramProcess::fail(std::string_view reason) const {
  throw ModelProgramError(fmt::format("model program = {} ({})", name_, reason));
}

void ProgramProcess::fail_unasked(std::string_view text) const {
  fail("answers what it was not asked: " + excerpt_of(text.substr(0, text.find('\n'))));
}

void ProgramProcess::write_some(std::string_view& text) const {
  const ssize_t size =
      send(questions_.number(), text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  if (size >= 0) {
    text.remove_prefix(static_cast<std::size_t>(size));
  } else if (errno != EAGAIN && errno != EINTR) {
    text = {};  // It has closed its input; that it has ended is seen where it should answer.
  }
}

void ProgramProcess::expect_silence() const {
  std::array<char, 81> part;  // NOLINT: recv() fills it.
  const ssize_t size = recv(answers_.number(), part.data(), part.size(), MSG_DONTWAIT | MSG_PEEK);
  if (size > 0) fail_unasked({part.data(), static_cast<std::size_t>(size)});
}

void ProgramProcess::read_some() {
  std::array<char, 65536> part;  // NOLINT: recv() fills it.
  const ssize_t size = recv(answers_.number(), part.data(), part.size(), MSG_DONTWAIT);
  if (size > 0) {
    received_.append(part.data(), static_cast<std::size_t>(size));
  } else if (size == 0 || (errno != EAGAIN && errno != EINTR)) {
    fail(fmt::format("gave no answer: {}", how_it_ended()));
  }
}

void ProgramProcess::pass_on_errors() {
  std::array<char, 65536> part;  // NOLINT: read() fills it.
  // No more than once what a pipe holds: a program may print without an end.
  const ssize_t size = read(errors_.number(), part.data(), part.size());
  if (size == 0) errors_ = Descriptor();  // It has closed it.
  if (size <= 0) return;
  const std::string_view text(part.data(), static_cast<std::size_t>(size));
  const std::size_t room = first_errors_size_max - std::min(first_errors_size_max, errors_size_);
  say_on(stderr, text.substr(0, room));
  errors_size_ += text.size();
  last_errors_ += text.substr(std::min(room, text.size()));
  if (last_errors_.size() <= last_errors_size_max) return;
  last_errors_.erase(0, last_errors_.size() - last_errors_size_max);
}

void ProgramProcess::ask(const std::vector<std::string>& questions,
                         const std::function<void(std::string_view answer)>& on_answer,
                         std::function<void()> on_silence) {
  using Clock = std::chrono::steady_clock;
  expect_silence();
  std::string all;
  for (const std::string& question : questions) all += question + '\n';
  std::string_view unsent = all;
  std::size_t num_answered = 0;
  Clock::time_point asked_at = Clock::now();
  while (num_answered < questions.size()) {
    std::array<pollfd, 3> ends{{{answers_.number(), POLLIN, 0},
                                {errors_.number(), POLLIN, 0},
                                {questions_.number(), POLLOUT, 0}}};
    const Clock::duration waited = Clock::now() - asked_at, most = answer_time_max_;
    if (waited >= most) {
      fail(fmt::format("no answer within {} s{}", answer_time_max_.count(),
                       has_answered_ ? "" : "; it must flush each answer"));
    }
    if (on_silence && waited >= most / 12) std::exchange(on_silence, nullptr)();
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>((on_silence ? most / 12 : most) - waited);
    poll(ends.data(), unsent.empty() ? 2 : 3, static_cast<int>(left.count()));
    if (ends[2].revents != 0) write_some(unsent);
    if (ends[1].revents != 0) pass_on_errors();
    if (ends[0].revents != 0) read_some();
    std::size_t begin = 0;
    for (std::size_t end = 0; (end = received_.find('\n', begin)) != std::string::npos;) {
      if (num_answered == questions.size()) break;
      on_answer(std::string_view(received_).substr(begin, end - begin));
      begin = end + 1;
      ++num_answered;
      has_answered_ = true;
      asked_at = Clock::now();
    }
    received_.erase(0, begin);
    if (received_.size() > answer_size_max) {
      fail(fmt::format("answers with a line of more than {} bytes", answer_size_max));
    }
  }
  if (!received_.empty()) fail_unasked(received_);
}

}  // namespace proofmass::wire
