#include "proto/model_program/program_description.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>
#include <set>

#include "core/campaign/expression.hpp"
#include "core/campaign/law_keys.hpp"
#include "core/campaign/law_set.hpp"
#include "core/campaign/name.hpp"
#include "core/definition/definition_text.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::wire {
namespace {

using Json = nlohmann::json;

constexpr std::size_t parameters_max = 1000;
constexpr std::size_t drawn_max = 1000;
constexpr std::size_t streams_max = 100;
constexpr std::size_t text_size_max = 200;
constexpr int questions_version = 1;

[[noreturn]] void refuse(const std::string& field, const Json& value, std::string_view rule) {
  std::string shown = value.dump(-1, ' ', false, Json::error_handler_t::replace);
  if (shown.size() > text_size_max) shown = shown.substr(0, text_size_max) + "...";
  throw ModelProgramError(
      fmt::format("description: {} = {} ({})", field, value.is_null() ? "nothing" : shown, rule));
}

std::string text_in(const Json& value, const std::string& field, std::size_t size_max) {
  const bool is_text = value.is_string() && value.get_ref<const std::string&>().size() <= size_max;
  if (is_text && visible_text(value.get_ref<const std::string&>()) == value) return value;
  refuse(field, value, fmt::format("must be a text of one line, at most {} bytes", size_max));
}

double number_in(const Json& value, const std::string& field) {
  if (value.is_number() && is_in_range(value.get<double>())) return value;
  refuse(field, value, "must be a number");
}

/// An object of the answer, of which each key is asked for by its name.
class Part {
 public:
  Part(const Json& object, std::string path) : object_(object), path_(std::move(path)) {
    if (!object.is_object()) refuse(path_.empty() ? "answer" : path_, object, "must be an object");
  }

  [[nodiscard]] std::string text_or(const std::string& key, const std::string& otherwise) const {
    return has(key) ? text(key) : otherwise;
  }
  [[nodiscard]] std::string text(const std::string& key,
                                 std::size_t size_max = text_size_max) const {
    return text_in(at(key), field(key), size_max);
  }
  /// A name in files and SQL.
  [[nodiscard]] std::string name() const {
    const std::string name = text("name");
    constexpr std::size_t size_max = 64;
    const auto is_allowed = [](char c) {
      return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_';
    };
    const bool begins_well = !name.empty() && name[0] >= 'a' && name[0] <= 'z';
    if (begins_well && name.size() <= size_max && std::ranges::all_of(name, is_allowed))
      return name;
    refuse(field("name"), name, "must be 1 to 64 of [a-z0-9_], a letter first");
  }
  [[nodiscard]] double number(const std::string& key, double otherwise) const {
    return has(key) ? number(key) : otherwise;
  }
  [[nodiscard]] double number(const std::string& key) const {
    return number_in(at(key), field(key));
  }
  [[nodiscard]] std::size_t count(const std::string& key, std::size_t otherwise,
                                  std::size_t most) const {
    if (!has(key)) return otherwise;
    const Json& value = at(key);
    if (!value.is_number_unsigned() || value < 1 || value > most) {
      refuse(field(key), value, fmt::format("must be a whole number in [1, {}]", most));
    }
    return value;
  }
  [[nodiscard]] bool flag(const std::string& key) const {
    if (!has(key)) return false;
    if (!at(key).is_boolean()) refuse(field(key), at(key), "must be true or false");
    return at(key);
  }
  /// The entries of a list, which is empty if there is none.
  void each(const std::string& key, std::size_t most,
            const std::function<void(const Json&, const std::string&)>& take) const {
    if (!has(key)) return;
    const Json& list = at(key);
    if (!list.is_array() || list.size() > most) {
      refuse(field(key), list, fmt::format("must be a list of at most {}", most));
    }
    for (std::size_t i = 0; i < list.size(); ++i)
      take(list[i], fmt::format("{}[{}]", field(key), i));
  }
  [[nodiscard]] const Json& at(const std::string& key) const {
    static const Json nothing;
    return has(key) ? object_.at(key) : nothing;
  }
  [[nodiscard]] std::string field(const std::string& key) const {
    return path_.empty() ? key : path_ + "." + key;
  }

 private:
  [[nodiscard]] bool has(const std::string& key) const { return object_.contains(key); }

  const Json& object_;
  std::string path_;
};

/// @param may_be_table  The law may be a table: its values are stored with the campaign.
ProgramDraw draw_in(const Part& part, bool may_be_table) {
  ProgramDraw draw;
  draw.name = part.name();
  draw.unit = part.text_or("unit", "1");
  const std::string law = part.text("law");
  const std::span<const std::string_view> names = names_of(Law{});
  const auto found = std::ranges::find(names, law);
  draw.law.law = static_cast<Law>(found - names.begin() + 1);
  if (found == names.end() || (draw.law.law == Law::table && !may_be_table)) {
    refuse(part.field("law"), law,
           fmt::format("must be {}; a table is named by a campaign file",
                       detail::alternatives(names)));
  }
  draw.law.is_independent = draw.law.law == Law::table && part.flag("independent");
  for (const std::string_view name : keys_of(draw.law.law)) {
    const std::string key(name);
    if (double* const number = number_at(draw.law, key)) {
      *number = part.number(key);
    } else if (auto* const numbers = numbers_at(draw.law, key)) {
      part.each(key, law_list_size_max, [&](const Json& entry, const std::string& path) {
        numbers->push_back(number_in(entry, path));
      });
    } else if (auto* const texts = texts_at(draw.law, key)) {
      part.each(key, law_list_size_max, [&](const Json& entry, const std::string& path) {
        texts->push_back(text_in(entry, path, text_size_max));
      });
    } else {
      *text_at(draw.law, key) = part.text(key, expression_size_max);
    }
  }
  return draw;
}

ProgramQuantity quantity_in(const Part& part) {
  ProgramQuantity quantity;
  quantity.name = part.name();
  quantity.truth = part.text("truth", expression_size_max);
  quantity.symbol = part.text_or("symbol", quantity.name);
  quantity.unit = part.text_or("unit", "1");
  quantity.display_scale = part.number("display_scale", 1.0);
  quantity.display_unit = part.text_or("display_unit", quantity.unit);
  quantity.objective = part.number("objective", quantity.objective);
  quantity.has_standard_error = part.flag("standard_error");
  if (quantity.display_scale <= 0.0) {
    refuse(part.field("display_scale"), quantity.display_scale, "must be > 0");
  }
  if (quantity.objective <= 0.0) refuse(part.field("objective"), quantity.objective, "must be > 0");
  return quantity;
}

/// Every name is there once, and a truth names what there is.
void check_names(const ProgramDescription& description) {
  std::set<std::string_view> inputs;
  const auto add = [](std::set<std::string_view>& names, std::string_view kind,
                      const std::string& name) {
    if (!names.insert(name).second) refuse(std::string(kind), name, "must have a name of its own");
  };
  for (const ProgramParameter& parameter : description.parameters)
    add(inputs, "parameters", parameter.name);
  for (const ProgramDraw& draw : description.drawn) add(inputs, "drawn", draw.name);
  std::set<std::string_view> names;
  for (const ProgramQuantity& quantity : description.quantities) {
    add(names, "quantities", quantity.name);
    try {
      (void)evaluate_expression(quantity.truth, [&](std::string_view name) {
        if (inputs.contains(name)) return 1.0;
        throw InvalidArgument(fmt::format("{} is neither drawn nor a parameter", name));
      });
    } catch (const InvalidArgument& error) {
      refuse(quantity.name + ".truth", quantity.truth, error.what());
    }
  }
  if (names.empty()) refuse("quantities", nullptr, "must be at least one");
}

void check_drawn(const ProgramDescription& description) {
  std::vector<std::string> names;
  std::vector<Dispersion> laws;
  for (const ProgramDraw& draw : description.drawn) {
    names.push_back(draw.name);
    laws.push_back(draw.law);
  }
  try {
    check_laws({.names = names, .laws = laws, .table = "drawn"});
  } catch (const ConfigError& error) {
    throw ModelProgramError(fmt::format("description: {}", error.what()));
  }
}

}  // namespace

ProgramDescription description_in(std::string_view answer) {
  if (answer.size() > answer_size_max) {
    throw ModelProgramError(
        fmt::format("description: {} bytes (must be at most {})", answer.size(), answer_size_max));
  }
  // What is nested deeper than a list of a law is no part of it, and would have to be written by a
  // recursive function.
  const auto is_kept = [](int depth, Json::parse_event_t, const Json&) { return depth <= 4; };
  const Json json = Json::parse(answer, is_kept, false);
  if (json.is_discarded()) throw ModelProgramError("description: no JSON");
  const Part part(json, "");
  if (part.at("proofmass_model_program") != questions_version) {
    refuse("proofmass_model_program", part.at("proofmass_model_program"),
           fmt::format("must be {}, the version of the questions", questions_version));
  }
  ProgramDescription description;
  description.text = json.dump();
  description.version = fmt::format("{}-{}", part.text("name"), part.text("version"));
  description.purpose =
      part.text_or("purpose", fmt::format("Runs campaigns of {}.", part.text("name")));
  description.imported_from = part.text_or("imported_from", "");
  description.runs_at_once = part.count("runs_at_once", 1, runs_at_once_max);
  description.limits = {
      .answer_time_max = std::chrono::seconds(part.count("run_time_max_s", 600, 86400)),
      .memory_max_mib = part.count("memory_max_mib", 4096, std::size_t{1} << 20)};
  if (!is_name(description.version)) refuse("name-version", description.version, is_name_rule);
  part.each("parameters", parameters_max, [&](const Json& entry, const std::string& path) {
    const Part of(entry, path);
    description.parameters.push_back({.name = of.name(), .value = of.number("value")});
  });
  part.each("quantities", quantities_max, [&](const Json& entry, const std::string& path) {
    description.quantities.push_back(quantity_in(Part(entry, path)));
  });
  part.each("drawn", drawn_max, [&](const Json& entry, const std::string& path) {
    description.drawn.push_back(draw_in(Part(entry, path), !description.imported_from.empty()));
  });
  part.each("streams", streams_max, [&](const Json& entry, const std::string& path) {
    description.streams.push_back(Part(entry, path).name());
  });
  check_names(description);
  check_drawn(description);
  return description;
}

}  // namespace proofmass::wire
