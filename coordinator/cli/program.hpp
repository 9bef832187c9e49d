#pragma once

#include <signal.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <thread>

#include "coordinator/archive/archive_error.hpp"
#include "coordinator/net/service.hpp"
#include "core/error.hpp"
#include "proto/model_program/model_choice.hpp"

namespace CLI {
class App;
}  // namespace CLI

namespace proofmass::coordinator {

/// How the programs end; documented in their --help.
enum ExitCode : int {
  exit_done = 0,
  exit_cannot_be_done = 1,  ///< Disk, database, address, workers that crash, time limits.
  exit_wrong_usage = 2,     ///< Arguments, campaign file or query.
  exit_not_met = 3,         ///< A requirement or stop rule is not met, audits contradict results,
                            ///< or runs that a plan probes are lost or do not fit.
  exit_interrupted = 130,   ///< SIGINT or SIGTERM; what is stored stands.
};

/// The end of `--help`.
/// @param further  What the command may end with beside 0, 1 and 2.
[[nodiscard]] std::string exit_codes_text(std::initializer_list<ExitCode> further);

/// The user asked for something that makes no sense.
using UsageError = InvalidArgument;

/// What is to be done once all arguments are parsed; returns an ExitCode.
using Command = std::function<int()>;

/// Parses the arguments, does the work and turns what goes wrong into a message and an exit code.
[[nodiscard]] int run_program(CLI::App& app, int argc, char** argv, const Command& work);

/// From now on SIGINT and SIGTERM, unless they are ignored, end the process at once with the words
/// and the exit code of an interruption: as long as there is nothing to be brought to an end.
void end_at_stop_signals();

/// Undoes end_at_stop_signals().
void let_stop_signals_kill();

/// Chooses the model, which is to be done first.
/// @param program  For the message.
/// @return The exit code if a program that is to simulate cannot be used, which it has said.
[[nodiscard]] std::optional<int> refused_model(int argc, char** argv, std::string_view program,
                                               wire::Broken broken);

/// All of `proofmass`, from its arguments to its exit code.
[[nodiscard]] int run_proofmass(int argc, char** argv);

/// All of `proofmass-coordinator`.
[[nodiscard]] int run_proofmass_coordinator(int argc, char** argv);

/// What the first SIGTERM asks for; SIGINT and a second SIGTERM ask to stop now. With `drain`,
/// SIGHUP asks to leave the workers to the next coordinator, unless the process was started with
/// SIGHUP ignored.
enum class OnTerminate : std::uint8_t { stop_now, drain };

/// From now on these signals end no process: they set the request that is returned, which lives
/// as long as the process.
[[nodiscard]] const std::atomic<StopRequest>& catch_stop_signals(OnTerminate on_terminate);

/// Does what reads or makes a database and may take long; SIGINT and SIGTERM end it in order: what
/// they make it throw, an Interrupted or a StoreError, is no failure.
/// @return The ExitCode of `work`, or exit_interrupted.
[[nodiscard]] int run_until_stopped(const std::function<int(const HeedStop&)>& work);

/// While it lives, SIGINT and SIGTERM interrupt no call of the thread that made it, nor of any
/// thread that is started after it: a thread of its own runs their handlers. libzmq needs that: any
/// of its calls, also one that does not wait, fails with EINTR if a signal comes at the wrong
/// moment. Processes that are started meanwhile inherit the blocked signals.
class SignalThread {
 public:
  SignalThread();
  ~SignalThread();
  SignalThread(const SignalThread&) = delete;
  SignalThread& operator=(const SignalThread&) = delete;

  /// SIGINT, SIGTERM and SIGHUP.
  [[nodiscard]] static sigset_t signals();

 private:
  sigset_t former_mask_{};
  std::jthread thread_;
};

}  // namespace proofmass::coordinator
