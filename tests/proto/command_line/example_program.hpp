#pragma once

#include <CLI/CLI.hpp>
#include <map>
#include <string>
#include <vector>

#include "proto/command_line/described_program.hpp"
#include "proto/command_line/option_checks.hpp"

namespace proofmass::test {

/// A program whose help texts hold all that roff or a shell could take for its own.
struct ExampleProgram {
  ExampleProgram() {
    app.set_version_flag("--version", "space-probe 1.2");
    app.footer("Exit codes:\n  0    done\n  130  interrupted; 'what is stored' stands");
    app.require_subcommand(1);
    app.add_option("-c,--config", text, "File with [options], as in\n`a = \"b\"`")
        ->type_name(wire::file_type)
        ->envname("PROBE_CONFIG");
    CLI::App& send =
        *app.add_subcommand("send", "Send it's \"data\": [all], C:\\a $HOME ~ ^ | `x`");
    send.add_option("DB", text, ".dots and 'quotes' first")->type_name("FILE.db")->required();
    send.add_option("PART", texts, "Further ones")->type_name("FILE.db");
    wire::add_choice(send, "--format", format, formats, "A\\B; %d -- 100 %");
    send.add_option("--runs", count, "Number of runs; e.g. 5")
        ->check(wire::in_range(1, 9))
        ->envname("PROBE_RUNS")
        ->capture_default_str();
    send.add_option("--set", texts, "KEY=VALUE; may be repeated")->allow_extra_args(false);
    send.add_option("--keys", text, "Keys")->type_name(wire::directory_type);
    send.add_flag("--force", is_forced, "'''");
    send.add_option("--secret", text, "Hidden")->group("");
    send.footer("Exit codes:\n  0    done");
    CLI::App& tag = *app.add_subcommand("tag", "Mark");
    tag.add_option("DB", text, "Database")->type_name("FILE.db")->required();
    wire::add_choice(tag, "ACTION", format, formats, "What to do");
    app.add_subcommand("internal", "Hidden")->group("");
  }

  [[nodiscard]] wire::DescribedCommand described() const { return wire::described_program(app); }

  CLI::App app{"Sends data.\n.And more.", "space-probe"};
  std::string text;
  std::vector<std::string> texts;
  bool is_forced = false;
  int count = 3;
  int format = 0;
  std::map<std::string, int> formats{{"json", 0}, {"two words", 1}, {"$HOME's", 2}};
};

}  // namespace proofmass::test
