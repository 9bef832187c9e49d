#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/json_output.hpp"
#include "coordinator/cli/standard_output.hpp"
#include "coordinator/store/store.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

enum class TagAction : std::uint8_t { print, add, remove };

struct TagOptions {
  std::filesystem::path database;
  TagAction action = TagAction::print;
  std::vector<std::string> tags;
  OutputFormat format = OutputFormat::text;
};

using AnnotationJson = nlohmann::ordered_json;

void print_tags(const TagOptions& options) {
  const std::vector<std::string> tags = Store::open_read_only(options.database).tags();
  if (options.format == OutputFormat::json) return print_json({{"tags", tags}});
  for (const std::string& tag : tags) print_lines(tag + "\n");
}

int tag_database(const TagOptions& options) {
  if (options.action == TagAction::print) {
    print_tags(options);
    return exit_done;
  }
  if (options.tags.empty()) throw UsageError("TAG = (must be given after add and remove)");
  std::vector<Annotation> annotations;
  for (const std::string& tag : options.tags) {
    if (options.action == TagAction::add) {
      annotations.emplace_back(AddTag{tag});
    } else {
      annotations.emplace_back(RemoveTag{tag});
    }
  }
  Store::annotate(options.database, annotations);
  if (options.format == OutputFormat::json) print_tags(options);
  return exit_done;
}

struct NoteOptions {
  std::filesystem::path database;
  std::optional<std::string> text;  ///< Prints the notes if there is none.
  OutputFormat format = OutputFormat::text;
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

void print_notes(const NoteOptions& options) {
  AnnotationJson json{{"notes", AnnotationJson::array()}};
  for (const Note& note : Store::open_read_only(options.database).notes()) {
    if (options.format == OutputFormat::json) {
      json["notes"].push_back({{"time_utc", note.time_utc}, {"text", note.text}});
    } else {
      print_lines(text_of(note));
    }
  }
  if (options.format == OutputFormat::json) print_json(json);
}

int note_database(const NoteOptions& options) {
  if (options.text) Store::annotate(options.database, {AddNote{*options.text}});
  if (!options.text || options.format == OutputFormat::json) print_notes(options);
  return exit_done;
}

}  // namespace

void add_tag(CLI::App& app, Command& chosen) {
  static const std::map<std::string, TagAction> actions{{"add", TagAction::add},
                                                        {"remove", TagAction::remove}};
  auto [command, options] = add_command<TagOptions>(
      app, chosen, "tag", "Add, remove or print tags of a campaign", tag_database);
  add_database(command, options.database);
  wire::add_choice(command, "ACTION", options.action, actions, "Without it prints the tags");
  command.add_option("TAG", options.tags, "1 to 64 letters, digits, dots, _ and -");
  add_json_flag(command, options.format);
}

void add_note(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<NoteOptions>(
      app, chosen, "note", "Add a note to a campaign, or print its notes", note_database);
  add_database(command, options.database);
  command.add_option("TEXT", options.text, "Up to 2,000 bytes; without it prints the notes");
  add_json_flag(command, options.format);
}

}  // namespace proofmass::coordinator
