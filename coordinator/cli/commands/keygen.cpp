#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <deque>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/net/authentication/rights.hpp"
#include "core/campaign/name.hpp"
#include "core/error.hpp"
#include "proto/command_line/option_checks.hpp"
#include "proto/link/keys.hpp"
#include "proto/link/whole_file.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

using wire::KeyRole;

struct KeygenOptions {
  std::filesystem::path directory;
  std::optional<std::string> worker;  ///< Adds a pair of this name for another worker.
  std::optional<std::string> client;  ///< Adds a pair of this name for another client.
};

std::string list_head(KeyRole role) {
  const bool is_client = role == KeyRole::client;
  return fmt::format(
      "# Public keys of the {0}s that may connect, one line `KEY NAME{1}` each.\n{2}"
      "# Remove a line to revoke a key; a running coordinator notices within three seconds.\n",
      to_text(role), is_client ? " [RIGHTS]" : "",
      is_client ? "# RIGHTS: a comma list of observe, submit (and control what the same NAME\n"
                  "# submitted), control (everybody's campaigns; release hosts);\n"
                  "# observe,submit if left out.\n"
                : "");
}

std::string list_line(const wire::KeyPair& pair, std::string_view name,
                      std::string_view rights = "") {
  return fmt::format("{} {}{}{}\n", pair.public_key.text(), name, rights.empty() ? "" : " ",
                     rights);
}

/// Files that belong together, none of which is there before: they are removed again unless all
/// were made, whether somebody asked to stop or the disk is full.
class FilesOfOneSet {
 public:
  /// @throws UsageError if one of them is there.
  FilesOfOneSet(const std::filesystem::path& directory, std::vector<std::string> names)
      : directory_(directory), names_(std::move(names)) {
    const auto is_missing = [&](const auto& name) {
      return !std::filesystem::exists(std::filesystem::symlink_status(directory / name));
    };
    const auto there = std::ranges::find_if_not(names_, is_missing);
    if (there == names_.end()) return;
    const auto missing = std::ranges::find_if(names_, is_missing);
    // As after a kill, which leaves no time to remove anything.
    const std::string advice =
        missing == names_.end()
            ? std::string()
            : fmt::format(
                  " {} is missing: put it back or, if no program has these keys, remove "
                  "the others;",
                  (directory / *missing).string());
    throw UsageError(fmt::format("key file = {} (exists;{} keys are never replaced)",
                                 (directory / *there).string(), advice));
  }
  ~FilesOfOneSet() {
    if (is_whole_) return;
    std::error_code ignored;
    for (const std::string& name : names_) std::filesystem::remove(directory_ / name, ignored);
    if (has_made_directory_) std::filesystem::remove(directory_, ignored);
  }
  FilesOfOneSet(const FilesOfOneSet&) = delete;
  FilesOfOneSet& operator=(const FilesOfOneSet&) = delete;

  void make_directory() {
    has_made_directory_ = ::mkdir(directory_.c_str(), 0700) == 0;
    if (has_made_directory_ || errno == EEXIST) return;
    throw Error(fmt::format("key directory = {} ({})", directory_.string(), std::strerror(errno)));
  }
  void keep() { is_whole_ = true; }

 private:
  std::filesystem::path directory_;
  std::vector<std::string> names_;
  bool has_made_directory_ = false;
  bool is_whole_ = false;
};

void make_whole_set(const std::filesystem::path& directory, const HeedStop& heed_stop) {
  FilesOfOneSet files(
      directory, {"coordinator.key", "coordinator.pub", "worker.key", "worker.pub", "client.key",
                  "client.pub", "authorized_workers", "authorized_clients"});
  files.make_directory();
  wire::check_key_directory(directory);
  wire::write_key_pair(directory, to_text(KeyRole::coordinator), KeyRole::coordinator,
                       wire::make_key_pair());
  for (const KeyRole role : {KeyRole::worker, KeyRole::client}) {
    heed_stop();
    const wire::KeyPair pair = wire::make_key_pair();
    // The person who sets a coordinator up may control all of its campaigns.
    const std::string_view rights = role == KeyRole::client ? "observe,submit,control" : "";
    wire::write_key_pair(directory, to_text(role), role, pair);
    wire::write_whole_file("allow-list", directory / list_name(role),
                           list_head(role) + list_line(pair, to_text(role), rights),
                           wire::trusted_mode, wire::IfThere::keep);
  }
  files.keep();
}

std::string read_list(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) {
    throw UsageError(fmt::format("allow-list = {} ({}; `proofmass keygen DIR` makes one)",
                                 file.string(), std::strerror(errno)));
  }
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

void say_where_to_copy(const std::filesystem::path& directory, KeyRole role,
                       std::string_view name) {
  const bool is_renamed = name != to_text(role);
  fmt::print(
      "{0} needs\na directory with two files, readable by its user alone:\n  {1}{2}\n  {3}\n",
      role == KeyRole::worker ? "A host of workers (proofmass-worker --keys)"
                              : "A person who submits and watches (proofmass --keys)",
      (directory / fmt::format("{}.key", name)).string(),
      is_renamed ? fmt::format("  as {}.key", to_text(role)) : "",
      (directory / "coordinator.pub").string());
}

/// A pair to add, of a name that is free: nothing is written before all are known to be.
class NewPair {
 public:
  NewPair(const std::filesystem::path& directory, KeyRole role, const std::string& name)
      : directory_(directory),
        role_(role),
        name_(checked(role, name)),
        list_(directory / list_name(role)),
        text_(read_list(list_)) {
    wire::check_key_directory(directory);
    for (const auto& [key, owner] : parse_allow_list(text_, role, list_)) {
      if (owner.name != name) continue;
      throw UsageError(
          fmt::format("--{} = {} (is in {} already)", to_text(role), name, list_.string()));
    }
    files_.emplace(directory, std::vector<std::string>{name + ".key", name + ".pub"});
  }

  /// Says what to copy where, too.
  void write() {
    const wire::KeyPair pair = wire::make_key_pair();
    wire::write_key_pair(directory_, name_, role_, pair);
    if (!text_.empty() && text_.back() != '\n') text_ += '\n';
    wire::write_whole_file("allow-list", list_, text_ + list_line(pair, name_), wire::trusted_mode,
                           wire::IfThere::replace);
    files_->keep();
    say_where_to_copy(directory_, role_, name_);
  }

 private:
  static const std::string& checked(KeyRole role, const std::string& name) {
    if (wire::is_name(name)) return name;
    throw UsageError(fmt::format("--{} = {} ({})", to_text(role), name, is_name_rule));
  }

  std::filesystem::path directory_;
  KeyRole role_;
  std::string name_;
  std::filesystem::path list_;
  std::string text_;
  std::optional<FilesOfOneSet> files_;
};

/// Makes a directory with the keys of a coordinator, of workers and of clients, and the lists of
/// who may connect; or adds pairs to one. Says what to copy where.
int make_keys(const KeygenOptions& options, const HeedStop& heed_stop) {
  const std::filesystem::path& directory = options.directory;
  if (options.worker && options.worker == options.client) {
    throw UsageError(
        fmt::format("--client = {} (must be another name than that of --worker)", *options.client));
  }
  std::deque<NewPair> pairs;
  if (options.worker) pairs.emplace_back(directory, KeyRole::worker, *options.worker);
  if (options.client) pairs.emplace_back(directory, KeyRole::client, *options.client);
  for (NewPair& pair : pairs) pair.write();
  if (!pairs.empty()) return exit_done;
  make_whole_set(directory, heed_stop);
  fmt::print(
      "wrote {0}\nKeep this directory on the coordinator's machine:\n"
      "  proofmass-coordinator --keys {0}\n"
      "The coordinator admits the keys in authorized_workers and authorized_clients.\n",
      directory.string());
  for (const KeyRole role : {KeyRole::worker, KeyRole::client}) {
    say_where_to_copy(directory, role, to_text(role));
  }
  return exit_done;
}

}  // namespace

void add_keygen(CLI::App& app, Command& chosen) {
  auto [command, options] = add_stoppable_command<KeygenOptions>(
      app, chosen, "keygen", "Make keys of a coordinator, workers, clients", make_keys);
  add_path(command, wire::directory_type, "DIRECTORY", options.directory,
           "Directory to make, or to add a key to")
      ->required();
  command.add_option("--worker", options.worker, "Add a key of this name for a worker");
  command.add_option("--client", options.client, "Add a key of this name for a client");
}

}  // namespace proofmass::coordinator
