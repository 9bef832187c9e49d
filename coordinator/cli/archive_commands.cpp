#include "coordinator/cli/archive_commands.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <system_error>
#include <thread>
#include <vector>

#include "coordinator/archive/comparison.hpp"
#include "coordinator/archive/comparison_text.hpp"
#include "coordinator/archive/listing.hpp"
#include "coordinator/archive/verification.hpp"
#include "coordinator/cli/archive_stop.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/standard_output.hpp"
#include "coordinator/store/store.hpp"
#include "proto/command_line/standard_error.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

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

}  // namespace

int verify_database(const VerifyCommandOptions& options) {
  return run_until_stopped([&](const IsStopped& is_stopped) {
    const VerifyOptions how{.fraction = options.fraction,
                            .num_threads = std::max(1U, std::thread::hardware_concurrency())};
    std::size_t num_failing = 0, num_checks = 0;
    const auto report = [&](const Check& check) {
      ++num_checks;
      if (check.verdict == Verdict::fails) ++num_failing;
      print_lines(check_text(check));
      flush_standard_output();  // The simulation may take long.
    };
    if (verify(options.database, how, report, is_stopped)) return exit_done;
    wire::say(fmt::format("proofmass: error: {}: {} of {} checks {}\n", options.database.string(),
                          num_failing, num_checks, num_failing == 1 ? "fails" : "fail"));
    return exit_cannot_be_done;
  });
}

int compare_databases(const CompareOptions& options) {
  return run_until_stopped([&](const IsStopped& is_stopped) {
    const Store first = Store::open_read_only(options.first);
    const Store second = Store::open_read_only(options.second);
    CampaignComparison comparison;
    first.read_one_state([&] {
      second.read_one_state([&] {
        comparison =
            compare_campaigns(read_compared(first, is_stopped), read_compared(second, is_stopped));
      });
    });
    const auto print = options.format == AnswerFormat::json ? comparison_json : comparison_text;
    print_lines(print(comparison, options.first.string(), options.second.string()));
    return exit_done;
  });
}

int list_databases(const ListOptions& options) {
  const std::vector<std::filesystem::path> here{"."};
  const auto campaigns = list_campaigns(options.places.empty() ? here : options.places);
  const auto print = options.format == AnswerFormat::json ? listing_json : listing_text;
  print_lines(print(campaigns));
  return exit_done;
}

int back_up_database(const std::filesystem::path& database,
                     const std::filesystem::path& destination) {
  std::error_code ignored;
  if (std::filesystem::exists(destination, ignored)) {
    throw UsageError(fmt::format("destination = {} (exists already)", destination.string()));
  }
  Store::open_read_only(database).back_up(destination);
  print_lines(fmt::format("wrote {}\n", destination.string()));
  return exit_done;
}

int tag_database(const TagOptions& options) {
  if (options.action == TagAction::print) {
    for (const std::string& tag : Store::open_read_only(options.database).tags()) {
      print_lines(tag + "\n");
    }
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
  return exit_done;
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

}  // namespace proofmass::coordinator
