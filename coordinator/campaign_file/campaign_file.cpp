#include "coordinator/campaign_file/campaign_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "core/campaign/definition.hpp"
#include "core/campaign/name.hpp"
#include "core/definition/document.hpp"
#include "core/model.hpp"
#include "core/result_rules.hpp"
#include "proto/link/whole_file.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {

namespace detail {
namespace {

[[noreturn]] void fail() {
  throw UnreadableFile(fmt::format("cannot be read: {}", std::strerror(errno)));
}

/// So many bytes of a file, or all if it has fewer.
std::string read_beginning(const std::filesystem::path& file, std::size_t size_max, Pipes pipes) {
  // Opening a pipe must not wait for its other end.
  const wire::Descriptor opened(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY));
  struct stat status {};
  if (opened.number() < 0 || ::fstat(opened.number(), &status) != 0) fail();
  if (S_ISDIR(status.st_mode)) throw UnreadableFile("is a directory");
  if (S_ISREG(status.st_mode)) {
    // What the kernel makes up, as in /proc, says that it has no bytes: reading it might wait for
    // ever.
    size_max = std::min(size_max, static_cast<std::size_t>(status.st_size));
  } else if (pipes == Pipes::refused) {
    throw UnreadableFile("is a pipe, a socket or a device");
  } else if (::fcntl(opened.number(), F_SETFL, 0) != 0) {  // Reading waits for who writes.
    fail();
  }
  std::string text(size_max, '\0');
  std::size_t size = 0;
  while (size < size_max) {
    const ssize_t num_read = ::read(opened.number(), text.data() + size, size_max - size);
    if (num_read < 0 && errno == EINTR) continue;
    if (num_read < 0) fail();
    if (num_read == 0) break;
    size += static_cast<std::size_t>(num_read);
  }
  text.resize(size);
  return text;
}

}  // namespace

// One byte more than allowed tells a file that is too large, also one without a known size.
std::string read_text_file(const std::filesystem::path& file, std::size_t size_max, Pipes pipes) {
  std::string text = read_beginning(file, size_max + 1, pipes);
  if (text.starts_with("SQLite format 3")) {  // A mistake that is made easily.
    throw UnreadableFile("is a database; give the text file");
  }
  if (text.size() > size_max) {
    throw UnreadableFile(fmt::format("is larger than {} bytes", size_max));
  }
  if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF")) {
    throw UnreadableFile("is UTF-16; save it as UTF-8");
  }
  text.erase(0, text.size() - wire::without_byte_order_mark(text).size());
  text.shrink_to_fit();
  return text;
}

std::string read_definition_text(const std::filesystem::path& file, std::size_t size_max,
                                 Pipes pipes) {
  try {
    return read_text_file(file, size_max, pipes);
  } catch (const UnreadableFile& error) {
    throw DefinitionError(fmt::format("{}: {}", file.string(), error.what()));
  }
}

}  // namespace detail

namespace {

Assignment count_assignment(std::string_view option, std::string_view path, std::uint64_t count) {
  const std::string origin = fmt::format("{} {}", option, count);
  return {origin, std::string(path), toml::table{{"value", static_cast<std::int64_t>(count)}}};
}

std::vector<Assignment> assignments_of(const Overrides& overrides) {
  std::vector<Assignment> assignments;
  for (const std::string& text : overrides.assignments) {
    assignments.push_back(parse_assignment(text));
  }
  if (overrides.num_runs) {
    assignments.push_back(count_assignment("--runs", "campaign.runs", *overrides.num_runs));
  }
  if (overrides.seed) {
    assignments.push_back(count_assignment("--seed", "campaign.seed", *overrides.seed));
  }
  return assignments;
}

/// Reads the data files that a definition names, each once.
class DataFilesIn final : public DataFiles {
 public:
  DataFilesIn(const Document& document, std::filesystem::path folder)
      : document_(document), folder_(std::move(folder)) {}

  const std::string& text_of(const std::string& file, const std::string& path) override {
    const auto known = texts_.find(file);
    if (known != texts_.end()) return known->second;
    try {
      return texts_[file] =
                 detail::read_text_file(folder_ / file, data_file_size_max, detail::Pipes::refused);
    } catch (const detail::UnreadableFile& error) {
      throw document_.located(ConfigError(path, fmt::format("\"{}\"", file), error.what()));
    }
  }

  [[nodiscard]] std::string name_of(const std::string& file) const override {
    return (folder_ / file).string();
  }

 private:
  const Document& document_;
  std::filesystem::path folder_;
  std::map<std::string, std::string> texts_;
};

std::string read_campaign_text(const std::filesystem::path& file) {
  return detail::read_definition_text(file, campaign_file_size_max, detail::Pipes::accepted);
}

/// The model that a campaign file names; null if it names none.
const Model* named_model(Document& document) {
  const std::string path = "campaign.model";
  std::string name;
  if (!document.read(path, name)) return nullptr;
  for (const Model* const known : models()) {
    if (name == known->version() || name == name_of_model(known->version())) return known;
  }
  throw document.located(
      ConfigError(path, fmt::format("\"{}\"", name),
                  fmt::format("this program has {}; --model-program names that of another model",
                              model_versions())));
}

std::unique_ptr<Campaign> read_campaign(Document& document, DataFiles& files) {
  if (const Model* const named = named_model(document)) {
    return named->read_campaign(document, files);
  }
  try {
    return model().read_campaign(document, files);
  } catch (const DefinitionError& error) {
    if (models().size() == 1) throw;
    throw DefinitionError(fmt::format("{}; it has no campaign.model and is taken to be of {}",
                                      error.what(), model().version()));
  }
}

}  // namespace

std::unique_ptr<Campaign> read_campaign(const std::filesystem::path& file,
                                        const Overrides& overrides) {
  Document document(file.string(), read_campaign_text(file), assignments_of(overrides));
  DataFilesIn files(document, file.parent_path());
  std::unique_ptr<Campaign> campaign = read_campaign(document, files);
  try {
    check_campaign_name(campaign->name, NameOrigin::given);
  } catch (const ConfigError& error) {
    throw document.located(error);
  }
  return campaign;
}

EnvironmentFile environment_file(const std::filesystem::path& file, const Overrides& overrides,
                                 const std::filesystem::path& physics, const std::string& session) {
  Document campaign(file.string(), read_campaign_text(file), assignments_of(overrides));
  std::string text;
  if (!physics.empty()) {
    text = detail::read_definition_text(physics, campaign_file_size_max, detail::Pipes::refused);
  }
  Document not_nominal(physics.string(), text, {});
  const Model* const named = named_model(campaign);
  return (named != nullptr ? *named : model()).environment_file(campaign, not_nominal, session);
}

std::unique_ptr<Campaign> example_campaign(const Model& of) {
  Document document("example", of.example(), {});
  DataFilesIn files(document, {});
  (void)named_model(document);
  return of.read_campaign(document, files);
}

std::vector<std::string> definition_differences(const Campaign& stored, const Campaign& wanted) {
  std::vector<std::string> texts;
  for (const auto& [field, first, second] : stored.differences_from(wanted)) {
    texts.push_back(fmt::format("{}: {} in the database, {} asked for", field, first, second));
  }
  return texts;
}

namespace {

constexpr std::size_t id_size_max = 64;
constexpr std::size_t text_size_max = 1000;
constexpr std::size_t requirement_size_max = 200;

void read_bounded(Document& document, const std::string& path, std::size_t size_max,
                  std::string& value) {
  if (document.read(path, value) && value.size() > size_max) {
    document.refuse(path, fmt::format("must have at most {} bytes", size_max));
  }
}

void read_id(Document& document, const std::string& path, std::set<std::string>& ids,
             std::string& id) {
  read_bounded(document, path, id_size_max, id);
  if (document.find(path) == nullptr) {
    document.refuse_absence(path, "must be given");
  } else if (id.empty()) {
    document.refuse(path, "must not be empty");
  } else if (!ids.insert(id).second) {
    document.refuse(path, "must be unique");
  }
}

void read_requirement(Document& document, const std::string& path, std::string& requirement) {
  read_bounded(document, path, requirement_size_max, requirement);
  if (document.find(path) == nullptr) {
    document.refuse_absence(path, "must be given, as in \"a < 9e-4 for 99% with 95%\"");
  }
}

/// @throws DefinitionError with what parse_requirement() says.
void check_requirement_of(const std::filesystem::path& file, std::size_t position,
                          const StatedRequirement& stated, const ResultSchema& results) {
  try {
    (void)parse_requirement(stated.requirement, results);
  } catch (const ConfigError& error) {
    throw DefinitionError(
        fmt::format("{}: requirements[{}].{}", file.string(), position, error.what()));
  }
}

}  // namespace

std::vector<StatedRequirement> read_requirements(const std::filesystem::path& file,
                                                 const ResultSchema& results) {
  Document document(
      file.string(),
      detail::read_definition_text(file, requirements_file_size_max, detail::Pipes::refused), {});
  const std::optional<std::size_t> count =
      document.num_tables("requirements", num_requirements_max);
  if (!count) document.refuse_absence("requirements", "must be a list of tables [[requirements]]");
  std::vector<StatedRequirement> stated(count.value_or(0));
  std::set<std::string> ids;
  for (std::size_t i = 0; i < stated.size(); ++i) {
    const std::string path = fmt::format("requirements[{}]", i);
    read_id(document, path + ".id", ids, stated[i].id);
    read_bounded(document, path + ".text", text_size_max, stated[i].text);
    read_requirement(document, path + ".requirement", stated[i].requirement);
  }
  document.check();
  for (std::size_t i = 0; i < stated.size(); ++i) {
    check_requirement_of(file, i, stated[i], results);
  }
  return stated;
}

}  // namespace proofmass::coordinator
