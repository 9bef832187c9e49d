#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "coordinator/cli/client.hpp"
#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/report/read_results.hpp"
#include "coordinator/report/status_notes.hpp"
#include "coordinator/store/sha256.hpp"
#include "coordinator/store/store.hpp"
#include "core/campaign/name.hpp"
#include "proto/link/whole_file.hpp"
#include "proto/wire/client_codec.hpp"
#include "proto/wire/names.hpp"

namespace proofmass::coordinator {
namespace {

int show_status(const ClientOptions& options) {
  const proto::StatusReply status = whole_status(connected(options));
  if (options.format == OutputFormat::json) {
    print_json(status_json(status));
  } else {
    TerminalStyle style = style_of(stdout);
    style.wraps_cells = true;
    write_standard_output(status_text(status, style));
  }
  return exit_done;
}

int show_workers(const ClientOptions& options) {
  const proto::WorkersReply workers = all_workers(connected(options));
  if (options.format == OutputFormat::json) {
    print_json(workers_json(workers));
  } else {
    write_standard_output(terminal_text(workers_table(workers), style_of(stdout)));
  }
  return exit_done;
}

}  // namespace

void add_status(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<ClientOptions>(
      app, chosen, "status", "Show the progress of a coordinator's campaigns", show_status);
  add_client_options(command, options);
}

void add_workers(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<ClientOptions>(
      app, chosen, "workers", "Show the workers of a coordinator", show_workers);
  add_client_options(command, options);
}

namespace {

using proto::ControlAction;

struct ControlOptions {
  ClientOptions client;
  ControlAction action = proto::CONTROL_ACTION_PAUSE;
  std::string campaign;
  std::optional<int> priority;  ///< For set_priority.
};

int control_campaign(const ControlOptions& options) {
  proto::RequestEnvelope request;
  proto::ControlRequest& control = *request.mutable_control();
  control.set_action(options.action);
  control.set_campaign(checked_campaign_name(options.campaign));
  control.set_priority(options.priority.value_or(0));
  print_done(
      connected(options.client), request,
      {.name = wire::name_of(options.action), .kind = "campaign", .target = options.campaign},
      options.client.format);
  return exit_done;
}

void add_action(CLI::App& app, Command& chosen, ControlAction action,
                const std::string& description) {
  auto [command, options] = add_command<ControlOptions>(
      app, chosen, std::string(wire::name_of(action)), description, control_campaign);
  options.action = action;
  command.add_option("NAME", options.campaign, "Campaign")->required();
  if (action == proto::CONTROL_ACTION_SET_PRIORITY) {
    add_number(command, "PRIORITY", options.priority, {-wire::priority_max, wire::priority_max},
               "-100 to 100; higher ones are computed first")
        ->required();
  }
  add_client_options(command, options.client);
}

struct ReleaseOptions {
  ClientOptions client;
  std::string host;
};

int release_host(const ReleaseOptions& options) {
  if (!wire::is_name(options.host)) {
    throw UsageError(fmt::format("host = \"{}\" ({})", options.host, is_name_rule));
  }
  proto::RequestEnvelope request;
  request.mutable_release_host()->set_host(options.host);
  print_done(connected(options.client), request,
             {.name = "release", .kind = "host", .target = options.host}, options.client.format);
  return exit_done;
}

}  // namespace

void add_control(CLI::App& app, Command& chosen) {
  add_action(app, chosen, proto::CONTROL_ACTION_PAUSE,
             "Lend no more runs of a campaign until `resume`");
  add_action(app, chosen, proto::CONTROL_ACTION_RESUME, "Continue a paused or cancelled campaign");
  add_action(app, chosen, proto::CONTROL_ACTION_CANCEL,
             "Drop a campaign's open runs; results stay");
  add_action(app, chosen, proto::CONTROL_ACTION_SET_PRIORITY,
             "Compute a campaign earlier or later");
  add_action(app, chosen, proto::CONTROL_ACTION_RETRY,
             "Compute the given-up runs of a campaign again");
  add_action(app, chosen, proto::CONTROL_ACTION_ARCHIVE,
             "Serve a finished or cancelled campaign no longer");
}

void add_release(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<ReleaseOptions>(
      app, chosen, "release", "Lend runs to a host in quarantine again", release_host);
  command.add_option("HOST", options.host, "Host, as `proofmass workers` names it")->required();
  add_client_options(command, options.client);
}

namespace {

struct FetchOptions {
  ClientOptions client;
  std::string campaign;
  std::optional<std::filesystem::path> file;  ///< By default NAME.db.
};

struct FullDisk : Error {
  using Error::Error;
};

/// What has arrived of a database, in a file that outlives this process: a later one goes on. There
/// is no file as long as nothing has arrived.
class ArrivedPart {
 public:
  /// Takes the file, if there is one, for this process alone until it ends: what another one wrote
  /// to it after it got its final name would be in the finished database.
  /// @throws Error if the file is there and cannot be read or is another process's, or is not and
  ///         cannot be made.
  explicit ArrivedPart(std::filesystem::path path) : path_(std::move(path)) {
    if (!open(wire::IfAbsent::leave)) {
      check_directory();
      return;
    }
    lock();
    read_again();
  }

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::uint64_t size() const { return size_; }
  [[nodiscard]] const std::string& sha256() const { return sha256_; }

  /// What is in the file now.
  void read_again() {
    if (lseek(file_.number(), 0, SEEK_SET) != 0) fail();
    size_ = 0;
    std::vector<char> block(std::size_t{1} << 20);
    Sha256 hash;
    ssize_t num_read = 0;
    while ((num_read = read(file_.number(), block.data(), block.size())) > 0) {
      hash.add_bytes({block.data(), static_cast<std::size_t>(num_read)});
      size_ += static_cast<std::uint64_t>(num_read);
    }
    if (num_read < 0) fail();
    sha256_ = hash.finish();
  }

  void clear() {
    if (file_.number() < 0) return;
    if (ftruncate(file_.number(), 0) != 0 || lseek(file_.number(), 0, SEEK_SET) != 0) fail();
    size_ = 0;
  }

  void append(std::string_view bytes) {
    if (file_.number() < 0) make();
    if (!wire::write_all(file_.number(), bytes)) fail();
    size_ += bytes.size();
  }

 private:
  /// So that the coordinator makes no copy in vain.
  void check_directory() const {
    const std::filesystem::path directory = path_.parent_path();
    if (access(directory.empty() ? "." : directory.c_str(), W_OK | X_OK) != 0) fail();
  }

  bool open(wire::IfAbsent if_absent) {
    file_ = wire::Descriptor(wire::open_own_file("file", path_, if_absent));
    return file_.number() >= 0;
  }

  void make() {
    open(wire::IfAbsent::make);
    lock();
    if (ftruncate(file_.number(), 0) != 0) fail();
  }

  // Its last owner may have renamed or removed it between our opening and locking it.
  void lock() const {
    if (wire::lock_file(file_.number()) != wire::Locked::by_another && has_its_name()) return;
    throw Error(fmt::format("file = {} (is being written by another `fetch`; try again later)",
                            path_.string()));
  }

  [[nodiscard]] bool has_its_name() const {
    struct stat opened {};
    struct stat present {};
    return fstat(file_.number(), &opened) == 0 && stat(path_.c_str(), &present) == 0 &&
           opened.st_dev == present.st_dev && opened.st_ino == present.st_ino;
  }

  [[noreturn]] void fail() const {
    const int error = errno;
    const std::string text = fmt::format("file = {} ({})", path_.string(), std::strerror(error));
    if (error == ENOSPC || error == EDQUOT) throw FullDisk(text);
    throw Error(text);
  }

  std::filesystem::path path_;
  wire::Descriptor file_;
  std::uint64_t size_ = 0;
  std::string sha256_;  ///< As it was last read.
};

/// A coordinator may announce any size, also one for which the disk has no room.
void require_space(const std::filesystem::path& file, std::uint64_t size) {
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(wire::directory_of(file), error);
  if (error || size <= space.available) return;
  throw Error(fmt::format("file = {} (the database has {} bytes more, the disk has room for {})",
                          file.string(), size, space.available));
}

/// Completes the part. @throws Error if it is not what the coordinator announced; then it is gone,
/// as it is if the disk is full: nobody else shall lack the space.
void complete(ArrivedPart& part, const Ask& ask, const proto::AnswerReply& answer) {
  if (answer.offset() != part.size()) part.clear();
  require_space(part.path(), answer.size() - std::min(answer.size(), part.size()));
  std::error_code ignored;
  try {
    read_answer(ask, answer, [&](std::string_view bytes) { part.append(bytes); });
  } catch (const FullDisk&) {
    std::filesystem::remove(part.path(), ignored);
    throw;
  }
  part.read_again();
  if (part.sha256() == answer.sha256()) return;
  std::filesystem::remove(part.path(), ignored);
  throw Error("the database is not the one that was announced; fetch it again");
}

/// Says what was fetched, after its results were held against the digest that came with them.
void print_fetched(const std::filesystem::path& file, OutputFormat format) {
  const WalkedResults walked = walk_checked(Store::open_read_only(file), [](const RunResult&) {});
  if (format == OutputFormat::json) {
    return print_json({{"file", file.string()},
                       {"num_results", walked.num_results},
                       {"digest", walked.digest},
                       {"is_digest_checked", walked.is_digest_checked}});
  }
  print_lines(fmt::format(
      "wrote {}: {} results\nDigest {}\n{}", file.string(), walked.num_results, walked.digest,
      walked.is_digest_checked ? "" : "It was not checked: the campaign is not finished\n"));
}

int fetch_database(const FetchOptions& options) {
  const std::string name = checked_campaign_name(options.campaign);
  const std::filesystem::path file = options.file.value_or(name + ".db");
  check_new_file("file", file);
  Store::check_absence(file);
  const Ask ask = connected(options.client);
  ArrivedPart part(std::filesystem::path(file).concat(".part"));
  proto::RequestEnvelope question = question_about(name, proto::QUESTION_DATABASE);
  question.mutable_answer()->set_known_size(part.size());
  if (part.size() > 0) question.mutable_answer()->set_known_sha256(part.sha256());
  complete(part, ask, reply_of(ask, question, proto::ReplyEnvelope::kAnswer).answer());
  Store::check_absence(file);  // Again: completing it may have taken long.
  if (const int error = wire::publish_file(part.path(), file, wire::IfThere::keep); error != 0) {
    throw Error(fmt::format("file = {} ({})", file.string(), std::strerror(error)));
  }
  print_fetched(file, options.client.format);
  return exit_done;
}

}  // namespace

void add_fetch(CLI::App& app, Command& chosen) {
  auto [command, options] = add_command<FetchOptions>(
      app, chosen, "fetch", "Copy a campaign's database from a coordinator", fetch_database);
  command.add_option("NAME", options.campaign, "Campaign")->required();
  add_path(command, database_type, "FILE", options.file, "File to make; NAME.db by default");
  add_client_options(command, options.client);
}

}  // namespace proofmass::coordinator
