#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <exception>
#include <functional>
#include <iostream>
#include <string>
#include <string_view>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/standard_output.hpp"
#include "core/error.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/command_line/standard_error.hpp"

namespace proofmass::coordinator {

/// Parses the arguments, does the work and turns what goes wrong into a message and an exit code.
inline int run_program(CLI::App& app, int argc, char** argv, const std::function<int()>& work) {
  const auto fail = [&app](std::string_view what, int exit_code) {
    wire::say(fmt::format("{}: error: {}\n", app.get_name(), what));
    return exit_code;
  };
  try {
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
  } catch (const UsageError& error) {
    return fail(error.what(), exit_wrong_usage);
  } catch (const InvalidArgument& error) {
    return fail(error.what(), exit_wrong_usage);
  } catch (const std::exception& error) {
    return fail(error.what(), exit_cannot_be_done);
  }
}

}  // namespace proofmass::coordinator
