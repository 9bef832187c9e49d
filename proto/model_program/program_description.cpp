#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

#include "core/campaign/expression.hpp"
#include "core/campaign/name.hpp"
#include "core/campaign/result_columns.hpp"
#include "core/definition/definition_text.hpp"
#include "core/definition/document.hpp"
#include "core/definition/law_reader.hpp"
#include "core/math/hash.hpp"
#include "core/statistics/requirement.hpp"
#include "proto/model_program/described_model.hpp"
#include "proto/model_program/json_line.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::wire {
namespace {

using Json = nlohmann::json;

constexpr std::size_t parameters_max = 1000;
constexpr std::size_t drawn_max = 1000;
constexpr std::size_t streams_max = 100;
constexpr std::size_t text_size_max = expression_size_max;
constexpr int questions_version = 1;

/// A value as TOML, so that a Document finds what is wrong with it, as in a campaign file.
/// @param path  For messages.
std::string toml_text(const Json& value, const std::string& path) {
  std::vector<std::string> items;
  if (value.is_object()) {
    for (const auto& [key, item] : value.items()) {
      items.push_back(detail::quoted_text(key) + " = " + toml_text(item, path + "." + key));
    }
    return fmt::format("{{{}}}", fmt::join(items, ", "));
  }
  if (value.is_array()) {
    for (const Json& item : value) {
      items.push_back(toml_text(item, fmt::format("{}[{}]", path, items.size())));
    }
    return fmt::format("[{}]", fmt::join(items, ", "));
  }
  if (value.is_null()) throw DefinitionError(path + " = null (must have a value, or be left out)");
  if (value.is_number()) return detail::number_text(value);
  if (value.is_boolean()) return value.dump();
  const std::string text = value;
  if (text.size() <= text_size_max && visible_text(text) == text) return detail::quoted_text(text);
  throw DefinitionError(fmt::format("{} = {} (must be a text of one line, at most {} bytes)", path,
                                    visible_text(text.substr(0, text_size_max)), text_size_max));
}

/// The object of JSON that an answer is, of questions that this program asks.
Json json_in(std::string_view answer, const std::string& source) {
  if (answer.size() > answer_size_max) {
    throw DefinitionError(
        fmt::format("{}: {} bytes (must be at most {})", source, answer.size(), answer_size_max));
  }
  Json json;
  try {
    json = object_in(answer);
  } catch (const InvalidArgument& error) {
    throw DefinitionError(fmt::format("{}: {}: {}", source, error.what(), excerpt_of(answer)));
  }
  const Json version = json.value("proofmass_model_program", Json());
  if (version == questions_version) return json;
  throw DefinitionError(
      fmt::format("{}: proofmass_model_program = {:.20} (must be {}, the version of the questions)",
                  source, version.dump(), questions_version));
}

Document document_of(const Json& json, const std::string& source) {
  std::string text;
  for (const auto& [key, value] : json.items()) {
    text += fmt::format("{} = {}\n", detail::quoted_text(key),
                        toml_text(value, fmt::format("{}: {}", source, key)));
  }
  return Document(source, text, {}, Lines::left_out);
}

/// Reads the objects of a list, which may be missing.
/// @param read_entry  Of the path of one.
template <typename ReadEntry>
void read_each(Document& document, const std::string& list, std::size_t most,
               const ReadEntry& read_entry) {
  const std::size_t count = document.num_tables(list, most).value_or(0);
  for (std::size_t i = 0; i < count; ++i) read_entry(fmt::format("{}[{}]", list, i));
}

/// @param taken  By others of its kind.
std::string read_own_name(Document& document, const std::string& path,
                          std::set<std::string>& taken) {
  std::string name = read_name(document, path);
  if (!name.empty() && !taken.insert(name).second) {
    document.refuse(path + ".name", "must be a name of its own");
  }
  return name;
}

/// @param may_be_table  The law may be a table: its values are stored with the campaign.
Dispersion read_drawn_law(Document& document, const std::string& path, bool may_be_table) {
  const std::string key = path + ".law";
  if (document.find(key) == nullptr) {
    document.refuse_absence(key, "must be given");
    return {};
  }
  const Dispersion none{.law = Law{}};  // All keys of the law must be there.
  Dispersion law = read_law(document, path, none, false);
  if (law.law == Law::table && !may_be_table) {
    document.refuse(key, "must be another law: a table is named by a campaign file");
  }
  return law;
}

/// @param inputs  Names that the truth may have.
ProgramQuantity read_quantity(Document& document, const std::string& path,
                              const std::set<std::string>& inputs, std::set<std::string>& taken) {
  ProgramQuantity quantity;
  quantity.name = quantity.symbol = read_own_name(document, path, taken);
  if (document.read_needed(path + ".truth", quantity.truth)) {
    try {
      (void)evaluate_expression(quantity.truth, [&](std::string_view name) {
        if (inputs.contains(std::string(name))) return 1.0;
        throw InvalidArgument(fmt::format("{} is neither drawn nor a parameter", name));
      });
    } catch (const InvalidArgument& error) {
      document.refuse(path + ".truth", error.what());
    }
  }
  document.read(path + ".symbol", quantity.symbol);
  document.read(path + ".unit", quantity.unit);
  quantity.display_unit = quantity.unit;
  quantity.has_display_scale =
      document.read(path + ".display_scale", quantity.display_scale, range::positive);
  if (quantity.has_display_scale) {
    const std::string scale = detail::number_text(quantity.display_scale);
    quantity.display_unit = quantity.unit == "1" ? scale : scale + " " + quantity.unit;
  }
  document.read(path + ".display_unit", quantity.display_unit);
  document.read(path + ".objective", quantity.objective, range::positive);
  document.read(path + ".standard_error", quantity.has_standard_error);
  return quantity;
}

void read_lists(Document& document, ProgramDescription& description) {
  std::set<std::string> inputs, quantities, streams;
  read_each(document, "parameters", parameters_max, [&](const std::string& path) {
    description.parameters.push_back({.name = read_own_name(document, path, inputs)});
    document.read_needed(path + ".value", description.parameters.back().value);
  });
  read_each(document, "drawn", drawn_max, [&](const std::string& path) {
    description.drawn_names.push_back(read_own_name(document, path, inputs));
    document.read(path + ".unit", description.drawn_units.emplace_back("1"));
    description.laws.push_back(read_drawn_law(document, path, !description.imported_from.empty()));
  });
  read_each(document, "quantities", quantities_max, [&](const std::string& path) {
    description.quantities.push_back(read_quantity(document, path, inputs, quantities));
  });
  if (description.quantities.empty()) {
    document.refuse_absence("quantities", "must be a list with at least one");
  }
  read_each(document, "streams", streams_max, [&](const std::string& path) {
    description.streams.push_back(read_own_name(document, path, streams));
  });
}

}  // namespace

std::string read_name(Document& document, const std::string& path) {
  constexpr std::size_t size_max = 64;
  constexpr std::string_view letters = "abcdefghijklmnopqrstuvwxyz";
  const std::string key = path + ".name";
  std::string name;
  if (!document.read_needed(key, name)) return {};
  const bool is_allowed = name.find_first_not_of(std::string(letters) + "0123456789_") == name.npos;
  if (!name.empty() && name.size() <= size_max && is_allowed &&
      letters.find(name[0]) != letters.npos) {
    return name;
  }
  document.refuse(key, "must be 1 to 64 of [a-z0-9_], a letter first");
  return {};
}

void check_names(const DescribedModel& model, const std::string& source) {
  const auto refuse = [&](std::string_view list, std::string_view name, std::string_view meaning) {
    throw DefinitionError(
        fmt::format("{}: {}.{} (must have another name: {})", source, list, name, meaning));
  };
  const auto check_input = [&](std::string_view list, std::string_view name) {
    if (is_function(name)) refuse(list, name, "it is a function of expressions");
  };
  for (const ProgramParameter& parameter : model.parts().parameters) {
    check_input("parameters", parameter.name);
  }
  const std::vector<std::string> columns =
      result_column_names(model.results_of({}, model.version()));
  for (const DrawnQuantity& drawn : model.drawn()) {
    check_input("drawn", drawn.name);
    if (std::ranges::find(columns, drawn.name) == columns.end()) continue;
    refuse("drawn", drawn.name, "it is a column of the results");
  }
  for (const ProgramQuantity& quantity : model.parts().quantities) {
    if (quantity.name != all_objectives_word) continue;
    refuse("quantities", quantity.name, "requirements say `all objectives`");
  }
}

ProgramDescription description_in(std::string_view answer, const std::string& source) {
  Json json = json_in(answer, source);
  Document document = document_of(json, source);
  (void)document.find("proofmass_model_program");
  ProgramDescription description;
  description.text = json.dump();
  std::string name, version;
  document.read_needed("name", name);
  document.read_needed("version", version);
  description.version = fmt::format("{}-{}", name, version);
  description.purpose = fmt::format("Runs campaigns of {}.", name);
  document.read("purpose", description.purpose);
  document.read("imported_from", description.imported_from);
  ProgramLimits& limits = description.limits;
  document.read("runs_at_once", description.runs_at_once, range::between(1, runs_at_once_max));
  document.read("run_time_max_s", limits.answer_time_max_s, range::between(1, 86400));
  document.read("memory_max_mib", limits.memory_max_mib, range::between(1, 1 << 20));
  read_lists(document, description);
  document.check();
  for (const char* const key : {"purpose", "runs_at_once", "run_time_max_s", "memory_max_mib"}) {
    json.erase(key);
  }
  description.digest = fnv1a(json.dump());
  const LawSet set = description.law_set(description.laws);
  for (std::size_t i = 0; i < set.laws.size(); ++i) {
    if (!has_covariances(document, fmt::format("drawn[{}]", i))) continue;
    as_correlations(set, description.laws[i]);
  }
  try {
    if (!is_name(description.version)) {
      throw ConfigError("name-version", description.version, is_name_rule);
    }
    check_laws(set);
  } catch (const ConfigError& error) {
    throw DefinitionError(fmt::format("{}: {}", source, error.what()));
  }
  return description;
}

}  // namespace proofmass::wire
