#include <fmt/format.h>
#include <sys/mman.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <nlohmann/json.hpp>

#include "coordinator/archive/export.hpp"
#include "coordinator/archive/replay.hpp"
#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/archive/verification.hpp"
#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/report/report.hpp"
#include "coordinator/store/detail/schema.hpp"
#include "core/definition/definition_text.hpp"
#include "core/math/instruction_set.hpp"
#include "core/model.hpp"
#include "proto/link/machine.hpp"
#include "proto/link/whole_file.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {
namespace {

using std::filesystem::path;

constexpr const char* database_name = "campaign.db";

/// A directory for files that last no longer than the object.
struct WorkDirectory {
  WorkDirectory() {
    const char* const parent = std::getenv("TMPDIR");
    const bool is_set = parent != nullptr && *parent != '\0';
    std::string name = path(is_set ? parent : "/tmp") / "proofmass-archive-XXXXXX";
    if (mkdtemp(name.data()) == nullptr) {
      throw Error(fmt::format("temporary directory = {} ({})", name, std::strerror(errno)));
    }
    place = name;
  }
  ~WorkDirectory() {
    std::error_code ignored;
    std::filesystem::remove_all(place, ignored);
  }
  WorkDirectory(const WorkDirectory&) = delete;
  WorkDirectory& operator=(const WorkDirectory&) = delete;

  path place;
};

std::string text_of(const path& file) {
  return detail::read_text_file(file, data_file_size_max, detail::Pipes::refused);
}

void write_file(const path& file, std::string_view text, wire::IfThere if_there) {
  wire::write_whole_file("temporary file", file, text, wire::public_mode, if_there);
}

/// Runs a script of a shell.
/// @param arguments  `$1` and so on.
/// @return The first line of what it writes to standard error; empty if all went well.
std::string complaint_of(const char* script, std::initializer_list<std::string> arguments,
                         const HeedStop& heed_stop) {
  // In memory: a disk that is full would take the files' complaints that it is full.
  const wire::Descriptor complaints(memfd_create("complaints", MFD_CLOEXEC));
  if (complaints.number() < 0) throw Error(fmt::format("memory ({})", std::strerror(errno)));
  std::vector<std::string> words{"/bin/sh", "-c", fmt::format("export LC_ALL=C\n{}", script), "sh"};
  words.insert(words.end(), arguments);
  const int status = wire::wait_for_end(
      wire::start_program({.arguments = words, .descriptors = {0, 1, complaints.number()}}));
  heed_stop();
  const std::string text = text_of(fmt::format("/proc/self/fd/{}", complaints.number()));
  const std::size_t begin = text.find_first_not_of('\n');  // gzip begins with an empty line.
  if (begin == std::string::npos) return status == 0 ? "" : wire::end_text(status);
  return wire::visible_text(text.substr(begin, text.find('\n', begin) - begin));
}

// What is written.

template <typename Headings, typename Value>
void write_csv(const path& file, const Headings& headings, std::size_t num_rows,
               const Value& value_at) {
  std::string text = fmt::format("{}\n", fmt::join(headings, ","));
  for (std::size_t row = 0; row < num_rows; ++row) {
    for (std::size_t column = 0; column < headings.size(); ++column) {
      text += proofmass::detail::number_text(value_at(row, column));
      text += column + 1 < headings.size() ? ',' : '\n';
    }
  }
  write_file(file, text, wire::IfThere::keep);
}

/// Writes one file with a column for each law that has its values from a table.
/// @return What is to be set in the campaign file.
std::vector<std::string> write_draws(const Campaign& campaign, const path& folder) {
  std::vector<std::string> laws;  // `dispersion.offcentring_m.x`, in the order of the columns.
  std::vector<std::string> assignments;
  for (const DefinitionItem& item : campaign.items()) {
    constexpr std::string_view ending = ".law";
    if (!item.key.ends_with(ending) || item.value != DefinitionValue("table")) continue;
    laws.push_back(item.key.substr(0, item.key.size() - ending.size()));
    assignments.push_back(laws.back() + ".file=draws.csv");
    assignments.push_back(fmt::format("{0}.column={0}", laws.back()));
  }
  if (laws.empty()) return {};
  const std::size_t step = campaign.realisations;  // A row is of an instrument.
  write_csv(folder / "draws.csv", laws, (campaign.num_runs + step - 1) / step,
            [&](auto row, auto column) { return campaign.table_columns[column][row * step]; });
  return assignments;
}

/// Writes the campaign file and, from the database, the data that it names, whatever the files were
/// called that these were read from.
void write_campaign(const Campaign& campaign, const path& folder) {
  const Definition definition = campaign.definition(TableColumns::left_out);
  Overrides overrides{.assignments = write_draws(campaign, folder)};
  for (const auto& [key, width, values] : definition.tables) {
    const auto schema = std::ranges::find(campaign.model().tables(), key, &DataTableSchema::key);
    const std::string name = key.substr(0, key.find('.')) + ".csv";
    write_csv(folder / name, schema->columns, values.size() / width,
              [&](auto row, auto column) { return values[row * width + column]; });
    overrides.assignments.push_back(fmt::format("{}={}", key, name));
  }
  const path file = folder / "campaign.toml";
  write_file(file, definition.text, wire::IfThere::keep);
  const std::unique_ptr<const Campaign> copy = read_campaign(file, overrides);
  for (const std::string& difference : definition_differences(campaign, *copy)) {
    throw ArchiveError("campaign.toml: " + difference);
  }
  write_file(file, copy->definition(TableColumns::left_out).text, wire::IfThere::replace);
}

/// The program of a model is for the reader to name.
std::string run_command(const Model& model) {
  const std::string command = "proofmass run campaign.toml --db again.db";
  return model.description().empty() ? command : command + " --model-program PROGRAM";
}

std::string command_of_all(const StopPlan& plan, const Model& model) {
  std::string command = run_command(model);
  if (plan.num_runs_max) command += fmt::format(" --runs {}", *plan.num_runs_max);
  if (!plan.stop_rule.empty()) command += " --until " + wire::shell_word(plan.stop_rule);
  if (plan.failures_max) command += fmt::format(" --failures {}", *plan.failures_max);
  return command;
}

/// More commands than these nobody types, one by one.
constexpr std::size_t ranges_max = 20;

/// What repeats the runs that have a result, in paragraphs. Those of a campaign that stopped half
/// way are whichever had come, and only their ranges say which.
std::string repetition_text(const Store& store, std::string_view digest) {
  const std::vector<RunRange> finished = store.finished_runs();
  const bool is_whole = store.control().phase == wire::CampaignPhase::finished &&
                        num_runs_in(finished) == store.num_runs();
  if (finished.empty()) return "There is nothing to repeat yet.\n";
  if (!is_whole && finished.size() > ranges_max) {
    return fmt::format(
        "The runs that have a result are in {} ranges, too many for commands that repeat them.\n",
        finished.size());
  }
  std::string commands;
  if (is_whole) commands = "    " + command_of_all(store.stop_plan(), store.model()) + "\n";
  for (const RunRange& range : is_whole ? std::vector<RunRange>() : finished) {
    commands += fmt::format("    {} --range {}:{}\n", run_command(store.model()), range.first.value,
                            range.end());
  }
  std::string text = fmt::format(
      "These commands repeat the {}, and print its digest again if every bit is the same:\n\n"
      "{}    proofmass report again.db | grep {}\n",
      is_whole ? "campaign" : "part of the campaign that has results", commands, digest);
  if (!store.model().description().empty()) {
    text += "\nPROGRAM is that of the model, which this archive does not hold.\n";
  }
  // Who has seen results must not make them those of a number of runs that was fixed before.
  if (is_whole && store.num_runs_fixed() != store.num_runs() &&
      store.stop_plan().stop_rule.empty()) {
    text +=
        "\nThe number of runs was not fixed before the first result: verdicts of campaign.db are "
        "sequential.\nThose of a repetition are not, and do not replace them.\n";
  }
  return text;
}

std::string readme_of(const Store& store, std::string_view digest) {
  const std::uint64_t num_finished = num_runs_in(store.finished_runs());
  const bool is_whole = store.control().phase == wire::CampaignPhase::finished;
  return fmt::format(
      R"(# Campaign {}

{} of {} runs have a result.{} The SHA-256 of all results is

    {}

- `campaign.toml`: the campaign, with the data files that it names (`*.csv`)
- `campaign.db`: every result and how it was computed, an SQLite database
- `report.html`, `report.txt`: what follows from the results
- `CITATION.cff`: how to cite them
- `SHA256SUMS`: checksums of all files, for `sha256sum --check SHA256SUMS`

{}
`proofmass publish --check ARCHIVE` checks all files, and computes some runs again.

Made by {}, model {}; database schema {}; archive made on a processor with {}.
)",
      store.name(), num_finished, store.num_runs(),
      is_whole ? "" : " **The campaign is not finished.**", digest, repetition_text(store, digest),
      store.build(), store.model_version(), detail::schema_version(),
      name_of(best_instruction_set()));
}

std::string citation_of(const Store& store, std::string_view digest,
                        std::span<const std::string> authors) {
  std::string text = fmt::format(
      "cff-version: 1.2.0\nmessage: Please cite these results as follows.\ntype: dataset\n"
      "title: Proofmass campaign {}, model {}\nauthors:\n",
      store.name(), store.model_version());
  for (const std::string& author : authors) {  // A text of JSON is one of YAML.
    text += fmt::format("  - name: {}\n", nlohmann::json(author).dump());
  }
  return text + fmt::format(
                    "identifiers:\n  - type: other\n    value: sha256:{}\n"
                    "    description: SHA-256 of all results\n",
                    digest);
}

/// Writes all files of an archive but the database, which is there, and the checksums.
void write_texts(const path& folder, std::span<const std::string> authors,
                 const HeedStop& heed_stop) {
  const Store store = Store::open_read_only(folder / database_name);
  const std::shared_ptr<const Campaign> campaign = stored_campaign(store);
  write_campaign(*campaign, folder);
  Review review = read_review(store, *campaign, ReviewDepth::causes);
  review.database = database_name;
  review.spectra = worst_run_spectra(store, review, heed_stop);
  const std::string& digest = review.results.digests.results;
  const auto write = [&](const char* name, const std::string& text) {
    write_file(folder / name, text, wire::IfThere::keep);
  };
  write("report.html", review_html(review));
  write("report.txt", report_text(review));
  write("README.md", readme_of(store, digest));
  write("CITATION.cff", citation_of(store, digest, authors));
}

constexpr const char* pack_script = R"sh(
cd "$1/$2" && sha256sum -- * >../sums && mv ../sums SHA256SUMS && cd .. &&
  tar --create --sort=name --mtime=@0 --owner=0 --group=0 --numeric-owner \
    --mode=u=rwX,go=rX -- "$2" | gzip --no-name >"$3")sh";

// What is read.

// Nothing may be wrong in what programs say, not even what they mend, such as absolute names.
// Directories that cannot be searched would stay for ever.
constexpr const char* unpack_script = R"sh(
cd "$3" || exit
gzip --decompress --stdout <"$1" | head --bytes="$2" |
  tar --extract --no-same-owner --no-same-permissions || exit
chmod -R u+rwX .
other=$(find . -mindepth 1 \( -path './*/*' \( ! -type f -o -links +1 -o -path './*/*/*' \) \
  -o ! -path './*/*' ! -type d \) -print -quit)
[ -z "$other" ] || echo "$other: is no plain file of one folder" >&2
[ "$(ls -A | wc -l)" = 1 ] || echo "it must have one folder" >&2
[ -f ./*/campaign.db ] || echo "it has no campaign.db" >&2)sh";

constexpr const char* sums_script = R"sh(
cd "$1" || exit
sha256sum --check --quiet --strict SHA256SUMS >&2 || exit
[ "$(ls -A | wc -l)" = $(($(wc -l <SHA256SUMS) + 1)) ] || echo "a file has no checksum" >&2)sh";

/// Unpacks an archive. @return Its folder.
path unpacked(const path& archive, const WorkDirectory& work, const HeedStop& heed_stop) {
  const auto refuse = [&](std::string_view why) {
    throw ArchiveError(fmt::format("archive = {} ({})", archive.string(), why));
  };
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(archive, error);  // None of a pipe.
  if (error) refuse(error.message());
  constexpr std::uintmax_t unpacked_size_max = std::uintmax_t{256} << 20;
  const path place = work.place / "files";
  std::filesystem::create_directory(place);
  const std::string complaint =
      complaint_of(unpack_script,
                   {std::filesystem::absolute(archive),
                    fmt::to_string(std::max(unpacked_size_max, 64 * size)), place},
                   heed_stop);
  if (!complaint.empty()) {
    const path parent = work.place.parent_path();
    refuse(fmt::format("cannot be unpacked in {}: {}", parent.string(), complaint));
  }
  return *std::filesystem::directory_iterator(place);
}

Check check_campaign(const path& folder) {
  const Store store = Store::open_read_only(folder / database_name);
  const std::string why_not_read = store.model().why_no_runs();
  std::vector<std::string> details;
  if (why_not_read.empty()) {
    details =
        definition_differences(*stored_campaign(store), *read_campaign(folder / "campaign.toml"));
  }
  Digest digest(store.schema());
  store.for_each_result([&](const RunResult& result) { digest.add(result); });
  const std::string results = digest.finish().results;
  for (const char* name : {"README.md", "CITATION.cff"}) {
    if (text_of(folder / name).find(results) != std::string::npos) continue;
    details.push_back(fmt::format("{} names another digest", name));
  }
  if (details.empty() && !why_not_read.empty()) {
    return Check::not_checked(
        fmt::format("digests are those of the database; campaign.toml: {}", why_not_read));
  }
  if (details.empty()) return Check::holds("campaign.toml and digests are those of the database");
  return Check::fails("the files are of another campaign than the database", std::move(details));
}

}  // namespace

void publish(const path& database, const path& archive, wire::IfThere if_there,
             std::span<const std::string> authors, const HeedStop& heed_stop) {
  const Store original = Store::open_read_only(database);
  if (!original.model().can_simulate()) {
    throw ArchiveError(
        fmt::format("model = {} ({})", original.model_version(), original.model().why_no_runs()));
  }
  const WorkDirectory work;
  (void)walk_results(original, heed_stop, [](const RunResult&) {});  // Damage, by its own name.
  const std::string folder = "proofmass-" + original.name();
  const path place = work.place / folder;
  std::filesystem::create_directory(place);
  original.back_up(place / database_name, heed_stop);
  write_texts(place, authors, heed_stop);
  wire::DraftFile draft("output", archive);
  const std::string complaint = complaint_of(
      pack_script, {work.place, folder, std::filesystem::absolute(draft.draft())}, heed_stop);
  if (!complaint.empty()) {
    throw Error(fmt::format("output = {} (cannot be written: {})", archive.string(), complaint));
  }
  draft.publish(if_there);
}

void check_publication(const path& archive, const VerifyOptions& options,
                       const std::function<void(const Check&)>& report, const HeedStop& heed_stop) {
  const WorkDirectory work;
  const path folder = unpacked(archive, work, heed_stop);
  const std::string complaint = complaint_of(sums_script, {folder}, heed_stop);
  Check sums = complaint.empty() ? Check::holds("of every file") : Check::fails(complaint);
  Check campaign;
  try {
    campaign = check_campaign(folder);
  } catch (const Error& error) {
    campaign = Check::fails(error.what());
  }
  sums.name = "checksums";
  campaign.name = "campaign";
  report(sums);
  report(campaign);
  verify(folder / database_name, options, report, heed_stop);
}

}  // namespace proofmass::coordinator
