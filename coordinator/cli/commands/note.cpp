#include <filesystem>
#include <optional>
#include <string>

#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/standard_output.hpp"
#include "coordinator/store/store.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

struct NoteOptions {
  std::filesystem::path database;
  std::optional<std::string> text;  ///< Prints the notes if there is none.
};

std::string text_of(const Note& note) {
  // Further lines of a note stand below its first.
  const std::string indent(note.time_utc.size() + 2, ' ');
  std::string text = wire::visible_text(note.time_utc) + "  ";
  for (const char character : note.text) {
    text += character;
    if (character == '\n') text += indent;
  }
  return text + "\n";
}

int note_database(const NoteOptions& options) {
  if (options.text) {
    Store::annotate(options.database, {AddNote{*options.text}});
    return exit_done;
  }
  for (const Note& note : Store::open_read_only(options.database).notes()) {
    print_lines(text_of(note));
  }
  return exit_done;
}

}  // namespace

void add_note(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<NoteOptions>(
      app, chosen, "note", "Add a note to a campaign, or print its notes", note_database);
  add_database(command, options.database);
  command.add_option("TEXT", options.text, "Up to 2,000 bytes; without it prints the notes");
}

}  // namespace proofmass::coordinator
