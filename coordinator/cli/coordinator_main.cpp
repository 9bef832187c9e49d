#include <cstddef>
#include <cstdint>
#include <map>
#include <string>

#include "coordinator/cli/program.hpp"
#include "coordinator/cli/serve_command.hpp"
#include "proto/command_line/option_checks.hpp"

namespace {

using namespace proofmass::coordinator;
namespace wire = proofmass::wire;

constexpr double drain_time_s_max = 366.0 * 86400.0;
constexpr std::uint64_t memory_mib_min = 64;
constexpr std::uint64_t memory_mib_max = std::uint64_t{1} << 24;
constexpr std::size_t campaigns_per_key_max = 1'000'000;
constexpr std::uint64_t bytes_per_key_max = std::uint64_t{1} << 50;

void add_addresses(CLI::App& app, ServeOptions& options) {
  app.add_option("--bind", options.endpoint,
                 "Where workers connect, ipc://PATH or\ntcp://HOST:PORT")
      ->envname("PROOFMASS_BIND")
      ->required();
  app.add_option("--bind-clients", options.clients_endpoint,
                 "Where clients connect; a socket in the\ndirectory by default")
      ->envname("PROOFMASS_BIND_CLIENTS");
  app.add_option("--keys", options.keys, "Directory of keys, made by `proofmass keygen`")
      ->envname("PROOFMASS_KEYS");
  app.add_flag("--insecure-plain", options.is_plain_waived,
               "Serve other machines without keys: on a\nnetwork that you trust");
}

void add_service(CLI::App& app, ServeOptions& options, bool& ends_when_done) {
  app.add_option("FILE", options.campaign_files, "Campaign files (TOML) to serve as well");
  app.add_option("--directory", options.directory, "Directory of the campaigns, one NAME.db each")
      ->envname("PROOFMASS_DIRECTORY")
      ->required();
  app.add_flag("--exit-when-done", ends_when_done, "End when every campaign is finished");
  app.add_option("--drain-time", options.drain_time_s,
                 "Seconds that workers have after SIGTERM to\ndeliver what they hold")
      ->check(wire::in_range(0.0, drain_time_s_max))
      ->capture_default_str();
  app.add_option(
         "--memory-max", options.memory_mib_max,
         "MiB of memory; before it has more it closes\nall connections, and peers connect anew")
      ->check(wire::in_range(memory_mib_min, memory_mib_max))
      ->envname("PROOFMASS_MEMORY_MAX")
      ->capture_default_str();
  app.add_option("--campaigns-per-key", options.limits.campaigns_max,
                 "Unfinished campaigns that a client's key may\nhave, at most")
      ->check(wire::in_range(std::size_t{1}, campaigns_per_key_max))
      ->capture_default_str();
  app.add_option("--bytes-per-key", options.limits.size_max,
                 "Bytes of the definitions of these campaigns,\nat most")
      ->check(wire::in_range(std::uint64_t{1}, bytes_per_key_max))
      ->capture_default_str();
  static const std::map<std::string, wire::LogFormat> formats{{"json", wire::LogFormat::json},
                                                              {"text", wire::LogFormat::text}};
  wire::add_choice(app, "--log-format", options.log_format, formats,
                   "Of the log on standard error; text by default")
      ->envname("PROOFMASS_LOG_FORMAT");
  // For tests of the program by itself.
  app.add_option("--faults", options.faults)->group("");
  app.add_option("--time-scale", options.time_scale)->group("")->check(CLI::PositiveNumber);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Lends the runs of campaigns to workers and stores their results.\n"
      "SIGTERM lets workers deliver what they hold; SIGINT, or a second one, does not.",
      "proofmass-coordinator");
  app.footer(exit_codes_text);
  app.set_version_flag("--version", "proofmass-coordinator " PROOFMASS_VERSION);
  app.set_config("--config", "", "File with these options, as in\n`bind = \"tcp://*:5555\"`")
      ->envname("PROOFMASS_CONFIG");
  app.allow_config_extras(CLI::config_extras_mode::error);
  ServeOptions options;
  bool ends_when_done = false;
  add_service(app, options, ends_when_done);
  add_addresses(app, options);
  return run_program(app, argc, argv, [&] {
    if (ends_when_done) options.end = ServiceEnd::when_done;
    return serve_campaigns(options);
  });
}
