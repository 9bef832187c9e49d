#include <CLI/CLI.hpp>
#include <filesystem>
#include <map>
#include <memory>
#include <string>

#include "coordinator/cli/archive_commands.hpp"
#include "coordinator/cli/command_line.hpp"
#include "coordinator/cli/export_command.hpp"
#include "proto/command_line/option_checks.hpp"

namespace proofmass::coordinator {
namespace {

// Each command shares its options with the callback that CLI11 keeps and with the chosen command.

constexpr const char* database_text = "Database of a campaign";

void add_format(CLI::App& command, AnswerFormat& format) {
  command.add_flag_callback(
      "--json", [&format] { format = AnswerFormat::json; }, "Print JSON");
}

void add_verify(CLI::App& app, Command& chosen) {
  const auto options = std::make_shared<VerifyCommandOptions>();
  CLI::App& command = *app.add_subcommand("verify", "Check a database, simulate some runs again");
  command.add_option("DB", options->database, database_text)->required();
  command.add_option("--fraction", options->fraction, "Of the runs to simulate again")
      ->check(wire::in_range(0.0, 1.0))
      ->capture_default_str();
  command.callback(
      [options, &chosen] { chosen = [options] { return verify_database(*options); }; });
}

void add_export(CLI::App& app, Command& chosen) {
  static const std::map<std::string, ExportFormat> formats{
      {"csv", ExportFormat::csv}, {"json", ExportFormat::json}, {"hdf5", ExportFormat::hdf5}};
  const auto options = std::make_shared<ExportOptions>();
  CLI::App& command = *app.add_subcommand("export", "Write all results of a database for others");
  command.add_option("DB", options->database, database_text)->required();
  wire::add_choice(command, "--format", options->format, formats,
                   "csv (the default), json or hdf5");
  command.add_option("--output", options->output, "File; standard output by default");
  command.add_flag("--force", options->is_forced, "Replace an existing file");
  command.add_flag_callback(
      "--draws", [options] { options->draws = DrawColumns::included; },
      "Add columns draw_... with what each run drew");
  command.callback([options, &chosen] { chosen = [options] { return export_results(*options); }; });
}

void add_backup(CLI::App& app, Command& chosen) {
  struct BackupOptions {
    std::filesystem::path database;
    std::filesystem::path destination;
  };
  const auto options = std::make_shared<BackupOptions>();
  CLI::App& command = *app.add_subcommand("backup", "Copy a database, also while it is written");
  command.add_option("DB", options->database, database_text)->required();
  command.add_option("DESTINATION", options->destination, "File to make")->required();
  command.callback([options, &chosen] {
    chosen = [options] { return back_up_database(options->database, options->destination); };
  });
}

void add_compare(CLI::App& app, Command& chosen) {
  const auto options = std::make_shared<CompareOptions>();
  CLI::App& command = *app.add_subcommand("compare", "Tell what two campaigns differ in");
  command.add_option("A", options->first, database_text)->required();
  command.add_option("B", options->second, database_text)->required();
  add_format(command, options->format);
  command.callback(
      [options, &chosen] { chosen = [options] { return compare_databases(*options); }; });
}

void add_list(CLI::App& app, Command& chosen) {
  const auto options = std::make_shared<ListOptions>();
  CLI::App& command = *app.add_subcommand("list", "List the campaigns of directories and files");
  command.add_option("PLACE", options->places, "Directories, databases; this directory by default");
  add_format(command, options->format);
  command.callback([options, &chosen] { chosen = [options] { return list_databases(*options); }; });
}

void add_tag(CLI::App& app, Command& chosen) {
  static const std::map<std::string, TagAction> actions{{"add", TagAction::add},
                                                        {"remove", TagAction::remove}};
  const auto options = std::make_shared<TagOptions>();
  CLI::App& command = *app.add_subcommand("tag", "Add, remove or print tags of a campaign");
  command.add_option("DB", options->database, database_text)->required();
  wire::add_choice(command, "ACTION", options->action, actions,
                   "add or remove; without it prints the tags");
  command.add_option("TAG", options->tags, "1 to 64 letters, digits, dots, _ and -");
  command.callback([options, &chosen] { chosen = [options] { return tag_database(*options); }; });
}

void add_note(CLI::App& app, Command& chosen) {
  const auto options = std::make_shared<NoteOptions>();
  CLI::App& command = *app.add_subcommand("note", "Add a note to a campaign, or print its notes");
  command.add_option("DB", options->database, database_text)->required();
  command.add_option("TEXT", options->text, "Up to 2,000 bytes; without it prints the notes");
  command.callback([options, &chosen] { chosen = [options] { return note_database(*options); }; });
}

}  // namespace

void add_archive_commands(CLI::App& app, Command& chosen) {
  add_verify(app, chosen);
  add_export(app, chosen);
  add_backup(app, chosen);
  add_compare(app, chosen);
  add_list(app, chosen);
  add_tag(app, chosen);
  add_note(app, chosen);
}

}  // namespace proofmass::coordinator
