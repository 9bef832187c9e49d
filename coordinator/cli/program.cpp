#include "coordinator/cli/program.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <condition_variable>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <iostream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <system_error>

#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/report/json.hpp"
#include "coordinator/store/records.hpp"
#include "core/campaign/definition.hpp"
#include "core/definition/definition_text.hpp"
#include "core/error.hpp"
#include "core/model.hpp"
#include "core/runs.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/link/machine.hpp"
#include "proto/link/whole_file.hpp"
#include "proto/model_program/program_model.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::string_view interrupted = "proofmass: interrupted\n";

/// A handler may do little more.
void end_at_once(int /*signal*/) {
  (void)!write(STDERR_FILENO, interrupted.data(), interrupted.size());
  _exit(exit_interrupted);
}

void handle_unless_ignored(int signal, void (*handler)(int)) {
  struct sigaction now {};
  sigaction(signal, nullptr, &now);
  if (now.sa_handler != SIG_IGN) std::signal(signal, handler);
}

}  // namespace

std::string exit_codes_text(std::initializer_list<ExitCode> further) {
  const auto may_be = [&](ExitCode code) { return std::ranges::count(further, code) > 0; };
  std::string text =
      "Exit codes:\n"
      "  0    done\n"
      "  1    cannot be done: disk, database, address, workers that crash, time limit\n"
      "  2    wrong usage, campaign file or query";
  if (may_be(exit_not_met))
    text += "\n  3    a requirement or stop rule is not met, audits contradict, or a plan fails";
  if (may_be(exit_interrupted)) {
    text += "\n  130  interrupted by SIGINT or SIGTERM; what is stored stands";
  }
  return text;
}

namespace {

/// An address that does not stand behind `=` would be taken for a file.
void refuse_page_address_apart(std::span<char* const> arguments) {
  const auto page = std::ranges::find(arguments, std::string_view("--page"));
  if (arguments.end() - page < 2) return;
  const std::string_view next = page[1];
  const std::size_t colon = next.rfind(':');
  if (colon == next.npos || next.find_first_not_of("0123456789", colon + 1) != next.npos) return;
  throw UsageError(fmt::format("page = {0} (an address stands behind =: --page={0})", next));
}

}  // namespace

int run_program(CLI::App& app, int argc, char** argv, const Command& work) {
  const auto fail = [&app](std::string_view what, int exit_code) {
    wire::say(fmt::format("{}: error: {}\n", app.get_name(), what));
    return exit_code;
  };
  try {
    wire::settle_surroundings();
    wire::refuse_options_as_values(app);
    refuse_page_address_apart({argv, static_cast<std::size_t>(argc)});
    app.parse(argc, argv);
    const int exit_code = work();
    flush_standard_output();
    return exit_code;
  } catch (const CLI::Success& wish) {
    const int exit_code = app.exit(wish);  // --help or --version.
    if (std::cout.flush()) return exit_code;
    return fail("standard output: cannot be written", exit_cannot_be_done);
  } catch (const CLI::ParseError& error) {
    return fail(wire::refusal_of(app, error), exit_wrong_usage);
  } catch (const DefinitionError& error) {
    return fail(error.what(), exit_wrong_usage);
  } catch (const ConfigError& error) {
    return fail(error.what(), exit_wrong_usage);
  } catch (const InvalidArgument& error) {
    return fail(error.what(), exit_wrong_usage);
  } catch (const std::exception& error) {
    return fail(error.what(), exit_cannot_be_done);
  }
}

void end_at_stop_signals() {
  for (const int signal : {SIGINT, SIGTERM}) handle_unless_ignored(signal, end_at_once);
}

void let_stop_signals_kill() {
  for (const int signal : {SIGINT, SIGTERM}) handle_unless_ignored(signal, SIG_DFL);
}

std::optional<int> refused_model(int argc, char** argv, std::string_view program,
                                 wire::Broken broken) {
  const auto fail = [&](const Error& error, ExitCode exit_code) {
    wire::say(fmt::format("{}: error: {}\n", program, wire::visible_text(error.what())));
    return exit_code;
  };
  try {
    wire::settle_surroundings();  // The pipes of a program are to be no standard descriptors.
  } catch (const Error& error) {
    return fail(error, exit_cannot_be_done);
  }
  try {
    const auto say = [&](const std::string& what) {
      wire::say(fmt::format("{}: {}\n", program, wire::visible_text(what)));
    };
    for (const std::string& why : wire::choose_models(argc, argv, broken, say)) {
      wire::say(fmt::format("{}: warning: {}; it is left out\n", program, wire::visible_text(why)));
    }
    return std::nullopt;
  } catch (const Error& error) {
    return fail(error, exit_wrong_usage);
  }
}

namespace {

/// Those that the variable names: what somebody asks for is not left out.
wire::Broken broken_programs(std::span<char* const> arguments) {
  const auto asks = [](std::string_view argument) {
    return argument.starts_with("--model-program") ||
           std::ranges::find(commands_with_programs, argument) != commands_with_programs.end();
  };
  return std::ranges::any_of(arguments, asks) ? wire::Broken::refused : wire::Broken::left_out;
}

}  // namespace

int run_proofmass(int argc, char** argv) {
  end_at_stop_signals();  // A program may take a while to say what its model is.
  const wire::Broken broken = broken_programs({argv, static_cast<std::size_t>(argc)});
  if (const auto refused = refused_model(argc, argv, "proofmass", broken)) return *refused;
  if (broken == wire::Broken::left_out) wire::end_fresh_programs();  // It computes nothing.
  CLI::App app(std::string(model().purpose()), "proofmass");
  app.footer(exit_codes_text({}));  // Of the commands, unless they say otherwise.
  app.set_version_flag("--version",
                       fmt::format("proofmass {} ({})", PROOFMASS_VERSION, model().version()));
  app.require_subcommand(1);
  wire::add_option_file(app, "TOML file with options, a section a command", "PROOFMASS_CONFIG");
  wire::add_model_program_option(app);
  app.fallthrough();  // Behind the command, too.
  Command chosen;
  for (const auto& [title, commands] : command_groups()) {
    app.group(title);  // A command begins with the group of its program.
    for (const auto& add : commands) add(app, chosen);
  }
  for (const std::string_view name : commands_with_programs) {
    wire::add_model_program_option(*app.get_subcommand(std::string(name)));
  }
  app.footer(exit_codes_text({exit_not_met, exit_interrupted}));
  return run_program(app, argc, argv, [&] {
    let_stop_signals_kill();
    return chosen();
  });
}

namespace {

// A signal handler can reach nothing but globals.
std::atomic<StopRequest> request = StopRequest::none;
std::atomic<StopRequest> request_of_first_terminate = StopRequest::now;
static_assert(std::atomic<StopRequest>::is_always_lock_free);

void on_signal(int signal) {
  const bool is_first = request == StopRequest::none;
  if (is_first && signal == SIGTERM) {
    request = request_of_first_terminate.load();
  } else if (signal != SIGHUP) {
    request = StopRequest::now;
  } else if (is_first) {
    request = StopRequest::leave;
  }
}

void run_handlers(const std::stop_token& stop) {
  const sigset_t signals = SignalThread::signals();
  pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
  std::mutex mutex;
  std::unique_lock lock(mutex);
  std::condition_variable_any().wait(lock, stop, [] { return false; });
}

}  // namespace

const std::atomic<StopRequest>& catch_stop_signals(OnTerminate on_terminate) {
  const bool drains = on_terminate == OnTerminate::drain;
  request_of_first_terminate = drains ? StopRequest::drain : StopRequest::now;
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  // `nohup` ignores it, and that must stay so.
  const bool leaves = drains && std::signal(SIGHUP, SIG_IGN) != SIG_IGN;
  if (leaves) std::signal(SIGHUP, on_signal);
  return request;
}

int run_until_stopped(const std::function<int(const HeedStop&)>& work) {
  const std::atomic<StopRequest>& stop = catch_stop_signals(OnTerminate::stop_now);
  try {
    return work([&stop] {
      if (stop != StopRequest::none) throw Interrupted();
    });
  } catch (const Interrupted&) {
  } catch (const StoreError&) {
    // A database that is being made says so of whatever ends its making.
    if (stop == StopRequest::none) throw;
  }
  wire::say("proofmass: interrupted\n");
  return exit_interrupted;
}

SignalThread::SignalThread() {
  const sigset_t blocked = signals();
  pthread_sigmask(SIG_BLOCK, &blocked, &former_mask_);
  thread_ = std::jthread(run_handlers);
}

SignalThread::~SignalThread() {
  thread_.request_stop();
  thread_.join();
  pthread_sigmask(SIG_SETMASK, &former_mask_, nullptr);
}

sigset_t SignalThread::signals() {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGINT);
  sigaddset(&set, SIGTERM);
  sigaddset(&set, SIGHUP);
  return set;
}

void add_override_options(CLI::App& command, Overrides& overrides) {
  add_number(command, "--runs", overrides.num_runs, {1, num_runs_max},
             "Number of runs; more than before extends");
  add_number(command, "--seed", overrides.seed, {0, seed_max}, "Seed of the campaign");
  command
      .add_option("--set", overrides.assignments,
                  "Replace a value of the file: TABLE.KEY=VALUE;\nmay be repeated")
      ->take_all()
      ->allow_extra_args(false);
  command.add_flag_callback(
      "--tolerate-digest",
      [&overrides] { overrides.assignments.emplace_back("campaign.tolerate_digest=true"); },
      "Accept machines where a model program computes\nother bits; the report says so");
}

std::string too_many_failures_text(std::uint64_t num_failures, std::uint64_t num_runs,
                                   std::uint64_t failures_max) {
  return fmt::format(
      "proofmass: error: {} of {} runs given up or without an estimate (at most {} with "
      "--failures); cancelled\n",
      num_failures, num_runs, failures_max);
}

std::string example_requirement() {
  const Quantity quantity = example_quantity(example_results());
  const double limit =
      std::isfinite(quantity.objective) ? quantity.objective : quantity.display_scale;
  return fmt::format("{} < {} for 99% with 95%", quantity.name,
                     proofmass::detail::number_text(limit));
}

void add_stop_options(CLI::App& command, StopPlan& options) {
  command.add_option("--until", options.stop_rule,
                     fmt::format("Stop as soon as the rule holds, as in\n\"std({}) within 5%\",\n"
                                 "\"all objectives within 2%\" or\n\"{} decided\"",
                                 example_quantity(example_results()).name, example_requirement()));
  add_number(command, "--failures", options.failures_max, {0, num_runs_max},
             "Cancel when more runs than this lack an estimate");
}

void add_audit_option(CLI::App& command, std::optional<double>& audit_fraction) {
  add_number(command, "--audit", audit_fraction, {0.0, 1.0},
             "Fraction of the runs to compute a second time, by\nanother worker if there is one, "
             "and compare");
}

void add_page_options(CLI::App& app, PageConfig& page) {
  app.add_flag("--page", page.address,
               "Serve the live page, at 127.0.0.1:5557 or at\n--page=HOST:PORT")
      ->envname("PROOFMASS_PAGE");
  add_path(app, wire::file_type, "--page-token-file", page.token_file,
           "File with a secret that visitors of the page\nmust show; needed beyond loopback")
      ->envname("PROOFMASS_PAGE_TOKEN_FILE");
}

namespace {

[[noreturn]] void fail_to_write() {
  throw Error(fmt::format("standard output: {}", std::strerror(errno)));
}

std::string_view value_of_variable(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr ? std::string_view() : value;
}

}  // namespace

ScreenSize screen_size_of(std::FILE* stream) {
  winsize size{};
  const bool is_known =
      ioctl(fileno(stream), TIOCGWINSZ, &size) == 0 && std::min(size.ws_col, size.ws_row) > 0;
  if (!is_known) return {};
  return {.columns = size.ws_col, .rows = size.ws_row};
}

bool takes_escapes(std::FILE* stream) {
  const std::string_view terminal = value_of_variable("TERM");
  return isatty(fileno(stream)) != 0 && !terminal.empty() && terminal != "dumb";
}

TerminalStyle style_of(std::FILE* stream) {
  TerminalStyle style;
  if (isatty(fileno(stream)) != 0) style.line_width_max = screen_size_of(stream).columns - 1;
  const bool is_painted = takes_escapes(stream) && value_of_variable("NO_COLOR").empty();
  style.paint = is_painted ? Paint::yes : Paint::no;
  return style;
}

void print_lines(std::string_view text) { write_standard_output(wire::visible_lines(text)); }

void say_reference_runs(const Model& model) {
  wire::say(fmt::format("proofmass: computing the reference runs of {}\n", model.version()));
}

void print_written(const std::filesystem::path& file, OutputFormat format) {
  if (format == OutputFormat::json) return print_json({{"file", file.string()}});
  print_lines(fmt::format("wrote {}\n", file.string()));
}

void print_json(const nlohmann::ordered_json& json) { print_lines(dumped(json)); }

void write_standard_output(std::string_view text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size()) fail_to_write();
}

void flush_standard_output() {
  if (std::fflush(stdout) != 0) fail_to_write();
}

// Files.

namespace {

constexpr std::string_view no_file = "must be a file; ./- is one of that name";

}  // namespace

void refuse_output(const std::filesystem::path& output, std::string_view why) {
  throw UsageError(fmt::format("output = {} ({})", output.string(), why));
}

void check_output_file(const std::filesystem::path& output, wire::IfThere if_there,
                       std::string_view remedy) {
  if (output == "-") refuse_output(output, no_file);
  std::error_code ignored;
  if (std::filesystem::is_symlink(output, ignored)) {
    refuse_output(output, "is a symbolic link; name the file that it leads to");
  }
  if (!std::filesystem::exists(output, ignored)) return;
  if (if_there == wire::IfThere::keep) {
    refuse_output(output, "exists already; replace it with --force");
  }
  if (!std::filesystem::is_regular_file(output)) {
    refuse_output(output, fmt::format("is no file; {}", remedy));
  }
  if (has_campaign_mark(output)) {
    refuse_output(output, "is a campaign, which --force does not replace");
  }
}

void check_document(const std::filesystem::path& file, wire::IfThere if_there) {
  if (file.empty() || file == "-") return;
  check_output_file(file, if_there, "- writes to standard output");
}

void check_no_input(const std::filesystem::path& output,
                    std::initializer_list<std::filesystem::path> inputs) {
  for (const std::filesystem::path& input : inputs) {
    std::error_code ignored;
    if (!std::filesystem::equivalent(output, input, ignored)) continue;
    refuse_output(output, "is what this command reads, which --force does not replace");
  }
}

void write_document(const std::filesystem::path& file, wire::IfThere if_there,
                    std::string_view text) {
  if (file == "-") return write_standard_output(text);
  wire::write_whole_file("output", file, text, wire::public_mode, if_there);
}

void check_new_file(std::string_view argument, const std::filesystem::path& file) {
  std::error_code error;
  if (file == "-") throw UsageError(fmt::format("{} = - ({})", argument, no_file));
  if (std::filesystem::exists(file, error)) {
    throw UsageError(fmt::format("{} = {} (exists already)", argument, file.string()));
  }
  if (!file.has_filename()) {
    throw UsageError(fmt::format("{} = \"{}\" (must name a file)", argument, file.string()));
  }
  const bool has_directory = std::filesystem::is_directory(wire::directory_of(file), error);
  if (has_directory || error == std::errc::permission_denied) return;  // Making it says more.
  throw Error(fmt::format("{} = {} (its directory does not exist)", argument, file.string()));
}

}  // namespace proofmass::coordinator
