#include "coordinator/campaign_file/requirements_file.hpp"

#include <fmt/format.h>

#include <set>
#include <string>

#include "coordinator/campaign_file/data_file.hpp"
#include "core/definition/document.hpp"
#include "core/result_rules.hpp"

namespace proofmass::coordinator {
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
