#include "coordinator/net/answers.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "coordinator/store/sha256.hpp"
#include "core/error.hpp"
#include "proto/link/machine.hpp"
#include "proto/link/whole_file.hpp"
#include "proto/model_program/model_choice.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::uint64_t memory_size_max = std::uint64_t{4} << 30;  // Of address space, bytes.
constexpr std::size_t block_size = std::size_t{1} << 20;
constexpr int niceness = 10;
constexpr int copy_duration_factor = 30;

/// A command that answers a question, and those of its options that only concern the answer.
struct AnswerCommand {
  proto::Question question;
  std::string_view name;
  std::vector<std::string_view> options;
};

const AnswerCommand& command_for(proto::Question question) {
  static const std::array<AnswerCommand, 4> commands{
      AnswerCommand{proto::QUESTION_REPORT, "report", {"--requirement", "--json"}},
      AnswerCommand{
          proto::QUESTION_SENSITIVITY, "sensitivity", {"--parameter", "--run", "--rows", "--json"}},
      AnswerCommand{
          proto::QUESTION_QUERY, "query", {"--format", "--timeout", "--rows-max", "--columns"}},
      AnswerCommand{proto::QUESTION_DATABASE, "backup", {}}};
  const auto* const found = std::ranges::find(commands, question, &AnswerCommand::question);
  PROOFMASS_EXPECT(found != commands.end());
  return *found;
}

/// An option with its value is one argument, so that the value cannot be another option.
void require_option(const AnswerCommand& command, std::string_view option) {
  const std::string_view name = option.substr(0, option.find('='));
  if (std::ranges::find(command.options, name) != command.options.end()) return;
  throw Error(fmt::format("option = {} (must be one of those of {} that a coordinator knows: {})",
                          name, command.name, fmt::join(command.options, " ")));
}

/// What a process is to do, and what it may need.
struct Order {
  std::vector<std::string> arguments;
  std::filesystem::path directory;  ///< For its output.
  std::optional<std::filesystem::path>
      copy;  ///< That it makes; otherwise its output is the answer.
  Clock::duration duration_max;
  std::uint64_t known_size = 0;
  std::string known_sha256;
};

double seconds_of(const Order& order) {
  return std::chrono::duration<double>(order.duration_max).count();
}

Order order_for(const proto::AnswerRequest& request, const ServiceConfig& config,
                const std::filesystem::path& database, std::uint64_t id) {
  const AnswerCommand& command = command_for(request.question());
  Order order{.arguments = {config.answer_program.string(), std::string(command.name)},
              .directory = config.answer_directory,
              .copy = {},
              .duration_max = config.answer_duration_max,
              .known_size = request.known_size(),
              .known_sha256 = request.known_sha256()};
  for (const std::string& option : request.options()) {
    require_option(command, option);
    order.arguments.push_back(option);
  }
  wire::add_model_programs(order.arguments);
  order.arguments.insert(order.arguments.end(),
                         {"--", std::filesystem::absolute(database).string()});
  if (request.question() == proto::QUESTION_QUERY) order.arguments.push_back(request.statement());
  if (request.question() == proto::QUESTION_DATABASE) {
    order.copy = config.answer_directory / fmt::format("copy-{:016x}.db", id);
    order.duration_max = copy_duration_factor * config.answer_duration_max;
    order.arguments.push_back(order.copy->string());
  }
  return order;
}

/// So that copies do not take the space that results need.
/// @param promised  Bytes of the copies that are being made.
/// @return Bytes of the copy.
std::uint64_t require_space(const Order& order, const std::filesystem::path& database,
                            std::uint64_t promised) {
  std::error_code error;
  const std::uint64_t size = std::filesystem::file_size(database, error);
  if (error) return 0;  // Making the copy says why.
  const std::filesystem::space_info space = std::filesystem::space(order.directory, error);
  const std::uint64_t wanted = 2 * (size + promised);
  if (error || space.available >= wanted) return size;
  throw Error(fmt::format(
      "disk of the coordinator's host {} = {} bytes available (must be {}, twice the size of the "
      "database{})",
      wire::host_name(), space.available, wanted,
      promised > 0 ? " and of those that are being copied; try again later" : ""));
}

/// @param directory  Is made if it is not there.
std::unique_ptr<wire::UnnamedFile> make_unnamed_file(const std::filesystem::path& directory) {
  mkdir(directory.c_str(), S_IRWXU);  // If that fails, so does what follows.
  std::string name = (directory / "output-XXXXXX").string();
  const int descriptor = mkostemp(name.data(), O_CLOEXEC);
  if (descriptor < 0) {
    throw Error(fmt::format("{}: {}", directory.string(), std::generic_category().message(errno)));
  }
  unlink(name.c_str());
  return std::make_unique<wire::UnnamedFile>(descriptor);
}

bool limit(pid_t process_id, __rlimit_resource resource, std::uint64_t maximum) {
  const rlimit wanted{.rlim_cur = maximum, .rlim_max = maximum};
  return prlimit(process_id, resource, &wanted, nullptr) == 0 || errno == ESRCH;
}

/// The kernel keeps them if this process ends first.
bool set_limits(pid_t process_id, const Order& order) {
  setpriority(PRIO_PROCESS, static_cast<id_t>(process_id), niceness);
  return limit(process_id, RLIMIT_CORE, 0) &&
         (!wire::has_address_space_limit || limit(process_id, RLIMIT_AS, memory_size_max)) &&
         limit(process_id, RLIMIT_CPU, static_cast<std::uint64_t>(std::ceil(seconds_of(order))));
}

/// Answers a question in a process.
/// @param answer  Gets what it writes to standard output.
/// @return What waitpid() says of its end; nothing if it was ended before.
/// @throws Error if the answer is too large.
std::optional<int> run(const Order& order, const wire::UnnamedFile& answer,
                       const wire::UnnamedFile& errors, const std::atomic<bool>& is_cancelled) {
  const wire::Descriptor nothing(open("/dev/null", O_RDONLY | O_CLOEXEC));
  const pid_t process_id = wire::start_program(
      {.arguments = order.arguments,
       .descriptors = {nothing.number(), answer.descriptor(), errors.descriptor()},
       .environment = wire::environment_without_settings()});
  const bool is_limited = set_limits(process_id, order);
  const Clock::time_point deadline = Clock::now() + order.duration_max;
  const auto is_too_large = [&] { return answer.size() + errors.size() > Answers::size_max; };
  const std::optional<int> status = wire::status_at_end(process_id, [&] {
    return is_limited && !is_cancelled && Clock::now() <= deadline && !is_too_large();
  });
  if (!is_limited) throw Error("answer: the process cannot be limited");
  if (!is_too_large()) return status;
  throw Error(fmt::format("the answer has more than {} bytes; ask for less, or fetch the database",
                          Answers::size_max));
}

/// @throws Error unless the process ended by itself.
int exit_code_of(const std::optional<int>& status, const Order& order) {
  const bool is_out_of_time = !status || (WIFSIGNALED(*status) && WTERMSIG(*status) == SIGXCPU);
  if (is_out_of_time) {
    throw Error(
        fmt::format("there was no answer within {:.3g} s; ask for less", seconds_of(order)));
  }
  if (!WIFEXITED(*status)) {
    throw Error(fmt::format("answer: the process was {}", wire::end_text(*status)));
  }
  return WEXITSTATUS(*status);
}

std::string sha256_of(const wire::UnnamedFile& file, std::uint64_t size) {
  Sha256 hash;
  for (std::uint64_t offset = 0; offset < size;) {
    const std::string block = file.read(offset, std::min<std::uint64_t>(block_size, size - offset));
    if (block.empty()) break;
    hash.add_bytes(block);
    offset += block.size();
  }
  return hash.finish();
}

proto::AnswerReply reply_about(const wire::UnnamedFile& file, const Order& order, int exit_code,
                               const std::string& error_text) {
  const std::uint64_t size = file.size();
  const bool is_known = order.known_size > 0 && order.known_size <= size &&
                        sha256_of(file, order.known_size) == order.known_sha256;
  proto::AnswerReply reply;
  reply.set_size(size);
  reply.set_sha256(sha256_of(file, size));
  reply.set_offset(is_known ? order.known_size : 0);
  reply.set_exit_code(static_cast<std::uint32_t>(exit_code));
  reply.set_error_text(error_text);
  return reply;
}

/// What the program says of its failure, without what whoever is told puts before it as well.
std::string failure_text(std::string_view text) {
  constexpr std::string_view beginning = "proofmass: error: ";
  if (text.starts_with(beginning)) text.remove_prefix(beginning.size());
  while (text.ends_with('\n')) text.remove_suffix(1);
  return std::string(text);
}

/// The standard output of the program is a file of the coordinator, and not the client's.
/// @throws Error if the program failed as it could not write it.
void require_written(std::string_view error_text) {
  constexpr std::string_view beginning = "standard output: ";
  const std::string text = failure_text(error_text);
  if (!text.starts_with(beginning)) return;
  throw Error(fmt::format("disk of the coordinator's host {} = {} (the answer is written there)",
                          wire::host_name(), text.substr(beginning.size())));
}

/// Removes the copy at the end, whatever happens.
struct CopyRemover {
  const std::optional<std::filesystem::path>& copy;
  ~CopyRemover() {
    std::error_code ignored;
    if (copy) std::filesystem::remove(*copy, ignored);
  }
};

}  // namespace

Answers::Answers(const ServiceContext& context) : context_(context) {}

Answers::~Answers() {
  for (const Computing& computing : computing_) *computing.is_cancelled = true;
}

void Answers::require_room(const std::string& owner) const {
  const auto num_own =
      static_cast<std::size_t>(std::ranges::count(computing_, owner, &Computing::owner));
  const auto num_unread = static_cast<std::size_t>(
      std::ranges::count_if(kept_, [](const auto& item) { return !item.second.is_read; }));
  const bool is_full = computing_.size() >= num_computing_max ||
                       num_unread + computing_.size() >= num_kept_max ||
                       (!owner.empty() && num_own >= num_computing_per_key);
  if (!is_full) return;
  throw Error(fmt::format("{} questions are being answered, which is the limit; try again later",
                          computing_.size() + num_unread));
}

void Answers::make_room() {
  if (kept_.size() + computing_.size() < num_kept_max) return;
  auto oldest = kept_.end();
  for (auto item = kept_.begin(); item != kept_.end(); ++item) {
    const bool is_older = oldest == kept_.end() || item->second.read_at < oldest->second.read_at;
    if (item->second.is_read && is_older) oldest = item;
  }
  if (oldest != kept_.end()) kept_.erase(oldest);
}

void Answers::ask(const proto::AnswerRequest& request, const std::filesystem::path& database,
                  const Asker& asker, Respond respond) {
  if (context_.config.answer_program.empty()) {
    throw Error(
        "this coordinator cannot answer questions about results, as the program proofmass is not "
        "beside proofmass-coordinator; install it there");
  }
  require_room(asker.name);
  const std::uint64_t id = std::max<std::uint64_t>(1, context_.start.epoch.value + num_answers_++);
  const Order order = order_for(request, context_.config, database, id);
  std::uint64_t promised = 0;
  for (const Computing& other : computing_) promised += other.copy_size;
  const std::uint64_t copy_size = order.copy ? require_space(order, database, promised) : 0;
  make_room();
  const auto is_cancelled = std::make_shared<std::atomic<bool>>(false);
  const auto compute = [order, id, is_cancelled]() -> Computed {
    const CopyRemover remover{order.copy};
    std::unique_ptr<wire::UnnamedFile> file = make_unnamed_file(order.directory);
    const wire::UnnamedFile errors(memfd_create("errors", MFD_CLOEXEC));  // A full disk is named.
    const int exit_code = exit_code_of(run(order, *file, errors, *is_cancelled), order);
    const std::string error_text = errors.read(0, wire::reply_text_size_max);
    if (exit_code != 0) require_written(error_text);
    if (order.copy && exit_code != 0) throw Error(failure_text(error_text));
    if (order.copy) {
      file = std::make_unique<wire::UnnamedFile>(open(order.copy->c_str(), O_RDONLY | O_CLOEXEC));
    }
    proto::AnswerReply reply = reply_about(*file, order, exit_code, error_text);
    reply.set_answer_id(id);
    return {.file = std::move(file), .reply = std::move(reply)};
  };
  computing_.push_back({.owner = asker.name,
                        .respond = std::move(respond),
                        .is_cancelled = is_cancelled,
                        .copy_size = copy_size,
                        .result = std::async(std::launch::async, compute)});
}

proto::ReplyEnvelope Answers::part(const proto::AnswerPartRequest& request, const Asker& asker) {
  const auto found = kept_.find(request.answer_id());
  if (found == kept_.end() || found->second.owner != asker.name) {
    throw Error("this answer is not kept any more; ask again");
  }
  Kept& kept = found->second;
  kept.read_at = context_.now();
  std::string content = kept.file->read(request.offset(), wire::answer_part_size_max);
  const bool is_end = request.offset() >= kept.size ||  // So that the difference is not negative.
                      kept.size - request.offset() <= content.size();
  if (is_end) kept.is_read = true;
  proto::ReplyEnvelope reply;
  reply.mutable_answer_part()->set_content(std::move(content));
  return reply;
}

void Answers::review() {
  for (auto item = computing_.begin(); item != computing_.end();) {
    const bool is_there =
        item->result.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
    if (is_there) finish(*item);
    item = is_there ? computing_.erase(item) : std::next(item);
  }
  const TimePoint now = context_.now();
  std::erase_if(kept_, [&](const auto& item) {
    return now - item.second.read_at > (item.second.is_read ? kept_after_end : kept_for);
  });
}

void Answers::finish(Computing& computing) {
  respond_or_say_why(computing.respond, [&] {
    Computed computed = computing.result.get();
    // A client that lacks nothing, of an empty answer for example, reads no part of it.
    kept_.emplace(computed.reply.answer_id(),
                  Kept{.owner = computing.owner,
                       .file = std::move(computed.file),
                       .size = computed.reply.size(),
                       .read_at = context_.now(),
                       .is_read = computed.reply.offset() >= computed.reply.size()});
    proto::ReplyEnvelope reply;
    *reply.mutable_answer() = std::move(computed.reply);
    computing.respond(std::move(reply));
  });
}

}  // namespace proofmass::coordinator
