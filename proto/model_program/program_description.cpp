#include "proto/model_program/program_description.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>
#include <set>
#include <variant>

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
constexpr std::size_t text_size_max = expression_size_max;
constexpr int questions_version = 1;

[[noreturn]] void refuse(const std::string& field, const Json& value, std::string_view rule) {
  std::string shown = value.dump(-1, ' ', false, Json::error_handler_t::replace);
  constexpr std::size_t shown_size_max = 200;
  if (shown.size() > shown_size_max) shown = shown.substr(0, shown_size_max) + "...";
  throw ModelProgramError(
      fmt::format("description: {} = {} ({})", field, value.is_null() ? "nothing" : shown, rule));
}

// Each of these takes a value of the answer, or refuses it.

void take(const Json& value, const std::string& field, std::string& text) {
  if (value.is_string()) text = value;
  if (!value.is_string() || text.size() > text_size_max || visible_text(text) != text) {
    refuse(field, value,
           fmt::format("must be a text of one line, at most {} bytes", text_size_max));
  }
}

void take(const Json& value, const std::string& field, double& number) {
  if (!value.is_number() || !is_in_range(value.get<double>())) {
    refuse(field, value, "must be a number");
  }
  number = value;
}

void take(const Json& value, const std::string& field, bool& flag) {
  if (!value.is_boolean()) refuse(field, value, "must be true or false");
  flag = value;
}

/// @param take_entry  Of an entry and its field.
template <typename TakeEntry>
void take_list(const Json& list, const std::string& field, std::size_t most,
               const TakeEntry& take_entry) {
  if (!list.is_array() || list.size() > most) {
    refuse(field, list, fmt::format("must be a list of at most {}", most));
  }
  for (std::size_t i = 0; i < list.size(); ++i) {
    take_entry(list[i], fmt::format("{}[{}]", field, i));
  }
}

template <typename Item>
void take(const Json& list, const std::string& field, std::vector<Item>& items) {
  take_list(list, field, law_list_size_max, [&](const Json& entry, const std::string& of_entry) {
    take(entry, of_entry, items.emplace_back());
  });
}

/// An object of the answer, of which each key is asked for by its name.
class Part {
 public:
  Part(const Json& object, std::string path) : object_(object), path_(std::move(path)) {
    if (!object.is_object()) refuse(path_.empty() ? "answer" : path_, object, "must be an object");
  }

  /// Null if it is not there.
  [[nodiscard]] const Json& at(const std::string& key) const {
    static const Json nothing;
    return object_.contains(key) ? object_.at(key) : nothing;
  }
  [[nodiscard]] std::string field(const std::string& key) const {
    return path_.empty() ? key : path_ + "." + key;
  }

  template <typename Value>
  void read(const std::string& key, Value& value) const {
    take(at(key), field(key), value);
  }
  /// Leaves the value alone if the key is not there.
  template <typename Value>
  void read_if_there(const std::string& key, Value& value) const {
    if (object_.contains(key)) read(key, value);
  }
  void read_if_there(const std::string& key, std::size_t& count, std::size_t most) const {
    if (!object_.contains(key)) return;
    if (!at(key).is_number_unsigned() || at(key) < 1 || at(key) > most) {
      refuse(field(key), at(key), fmt::format("must be a whole number in [1, {}]", most));
    }
    count = at(key);
  }
  /// A name in files and SQL.
  [[nodiscard]] std::string name() const {
    std::string name;
    read("name", name);
    constexpr std::size_t size_max = 64;
    const bool is_allowed =
        name.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_") == name.npos;
    const bool begins_well = !name.empty() && name[0] >= 'a' && name[0] <= 'z';
    if (begins_well && name.size() <= size_max && is_allowed) return name;
    refuse(field("name"), name, "must be 1 to 64 of [a-z0-9_], a letter first");
  }
  /// The objects of a list, which may be missing.
  void each(const std::string& key, std::size_t most,
            const std::function<void(const Part&)>& take_part) const {
    if (!object_.contains(key)) return;
    take_list(at(key), field(key), most, [&](const Json& entry, const std::string& of_entry) {
      take_part(Part(entry, of_entry));
    });
  }

 private:
  const Json& object_;
  std::string path_;
};

/// @param may_be_table  The law may be a table: its values are stored with the campaign.
Dispersion law_in(const Part& part, bool may_be_table) {
  std::string name;
  part.read("law", name);
  const std::span<const std::string_view> names = names_of(Law{});
  const auto found = std::ranges::find(names, name);
  Dispersion law{.law = static_cast<Law>(found - names.begin() + 1)};
  if (found == names.end() || (law.law == Law::table && !may_be_table)) {
    refuse(part.field("law"), name,
           fmt::format("must be {}; a table is named by a campaign file",
                       detail::alternatives(names)));
  }
  if (law.law == Law::table) part.read_if_there("independent", law.is_independent);
  for (const std::string_view key : keys_of(law.law)) {
    std::visit([&](auto* value) { part.read(std::string(key), *value); }, field_of(law, key));
  }
  return law;
}

ProgramQuantity quantity_in(const Part& part) {
  ProgramQuantity quantity;
  quantity.name = quantity.symbol = part.name();
  part.read("truth", quantity.truth);
  part.read_if_there("symbol", quantity.symbol);
  part.read_if_there("unit", quantity.unit);
  quantity.display_unit = quantity.unit;
  part.read_if_there("display_unit", quantity.display_unit);
  part.read_if_there("display_scale", quantity.display_scale);
  part.read_if_there("objective", quantity.objective);
  part.read_if_there("standard_error", quantity.has_standard_error);
  if (quantity.display_scale <= 0.0) {
    refuse(part.field("display_scale"), quantity.display_scale, "must be > 0");
  }
  if (quantity.objective <= 0.0) refuse(part.field("objective"), quantity.objective, "must be > 0");
  return quantity;
}

/// Every name is there once, and a truth names what there is.
void check_names(const ProgramDescription& description) {
  std::set<std::string_view> inputs, names;
  const auto add = [](std::set<std::string_view>& to, const char* kind, const std::string& name) {
    if (!to.insert(name).second) refuse(kind, name, "must have a name of its own");
  };
  for (const auto& parameter : description.parameters) add(inputs, "parameters", parameter.name);
  for (const std::string& name : description.drawn_names) add(inputs, "drawn", name);
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

void read_lists(const Part& part, ProgramDescription& description) {
  part.each("parameters", parameters_max, [&](const Part& parameter) {
    description.parameters.push_back({.name = parameter.name()});
    parameter.read("value", description.parameters.back().value);
  });
  part.each("quantities", quantities_max,
            [&](const Part& quantity) { description.quantities.push_back(quantity_in(quantity)); });
  part.each("drawn", drawn_max, [&](const Part& drawn) {
    description.drawn_names.push_back(drawn.name());
    drawn.read_if_there("unit", description.drawn_units.emplace_back("1"));
    description.laws.push_back(law_in(drawn, !description.imported_from.empty()));
  });
  part.each("streams", streams_max,
            [&](const Part& stream) { description.streams.push_back(stream.name()); });
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
  std::string name, version;
  part.read("name", name);
  part.read("version", version);
  description.version = fmt::format("{}-{}", name, version);
  if (!is_name(description.version)) refuse("name-version", description.version, is_name_rule);
  description.purpose = fmt::format("Runs campaigns of {}.", name);
  part.read_if_there("purpose", description.purpose);
  part.read_if_there("imported_from", description.imported_from);
  part.read_if_there("runs_at_once", description.runs_at_once, runs_at_once_max);
  part.read_if_there("run_time_max_s", description.limits.answer_time_max_s, 86400);
  part.read_if_there("memory_max_mib", description.limits.memory_max_mib, std::size_t{1} << 20);
  read_lists(part, description);
  check_names(description);
  try {
    check_laws(description.law_set(description.laws));
  } catch (const ConfigError& error) {
    throw ModelProgramError(fmt::format("description: {}", error.what()));
  }
  return description;
}

}  // namespace proofmass::wire
