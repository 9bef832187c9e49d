#include "core/definition/document.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/definition/definition_text.hpp"
#include "core/error.hpp"

namespace proofmass {
namespace {

using detail::alternatives;
using detail::number_text;
using detail::quoted_text;

constexpr std::size_t shown_text_length_max = 60;
constexpr std::size_t shown_path_length_max = 200;  // No key of a campaign file is as long.

std::string shortened(const std::string& path) {
  return path.size() <= shown_path_length_max ? path
                                              : path.substr(0, shown_path_length_max) + "...";
}

bool is_bare_key(std::string_view key) {
  return !key.empty() && std::ranges::all_of(key, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-';
  });
}

// A key with a dot inside must not pass for a path.
std::string path_of(const std::string& parent, std::string_view key) {
  const std::string spelled = is_bare_key(key) ? std::string(key) : quoted_text(key);
  return parent.empty() ? spelled : parent + "." + spelled;
}

// A value as people wrote it, for messages.
std::string text_of(const toml::node& content) {
  if (const auto* const text = content.as_string()) {
    if (text->get().size() <= shown_text_length_max) return quoted_text(text->get());
    return fmt::format("a text of {} bytes", text->get().size());
  }
  if (const auto* const number = content.as_floating_point()) return number_text(number->get());
  if (const auto* const number = content.as_integer()) return fmt::format("{}", number->get());
  if (const auto* const flag = content.as_boolean()) return flag->get() ? "true" : "false";
  if (const auto* const array = content.as_array()) {
    std::string text = "[";
    for (const toml::node& element : *array) {
      if (text.size() > 1) text += ", ";
      text += element.is_array() || element.is_table() ? "..." : text_of(element);
      if (text.size() > shown_text_length_max) return "a list";
    }
    return text + "]";
  }
  return content.is_table() ? "a table" : "a date or time";
}

// Parent of `a.b[0].c`: `a.b[0]`, then `a.b`, `a` and nothing.
std::string parent_of(const std::string& path) {
  const std::size_t end = path.find_last_of(".[");
  return end == std::string::npos ? std::string() : path.substr(0, end);
}

toml::table parse_text(std::string_view text, const std::string& name) {
  if (const std::optional<std::size_t> line = detail::line_of_deep_nesting(text)) {
    throw DefinitionError(fmt::format(
        "{0}:{1}: nesting = over {2} (parts of a key, and lists and tables in one another, must be "
        "at most {2})",
        name, *line, detail::nesting_max));
  }
  try {
    return toml::parse(text);
  } catch (const toml::parse_error& error) {
    throw DefinitionError(
        fmt::format("{}:{}: {}", name, error.source().begin.line, error.description()));
  }
}

// `session[3].orbits` of `session.a_c12.orbits` or `session[a_c12].orbits`: the tables of a list
// may go by their `name`.
std::string with_index(const toml::table& root, const Assignment& assignment) {
  const std::string& path = assignment.path;
  const std::size_t begin = std::min(path.find_first_of(".["), path.size());
  const std::string list_name = path.substr(0, begin);
  const toml::array* const list = root[list_name].as_array();
  const char closing = path[begin] == '[' ? ']' : '.';
  const std::size_t end = std::min(path.find(closing, begin + 1), path.size());
  if (list == nullptr || begin == path.size() || (closing == ']' && end == path.size()))
    return path;
  const std::string name = path.substr(begin + 1, end - begin - 1);
  if (closing == ']' && name.find_first_not_of("0123456789") == name.npos) return path;
  std::vector<std::string> names;
  for (const toml::node& entry : *list) {
    names.push_back(toml::at_path(entry, "name").value_or(std::string()));
    if (names.back() != name) continue;
    return fmt::format("{}[{}]{}", list_name, names.size() - 1,
                       path.substr(closing == ']' ? end + 1 : end));
  }
  throw DefinitionError(fmt::format("{}: {} = {} (must be one of {})", assignment.origin, list_name,
                                    name, fmt::join(names, " ")));
}

}  // namespace

Assignment parse_assignment(const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0) {
    throw DefinitionError(fmt::format("--set {}: must be key=value", text));
  }
  Assignment assignment{"--set " + text, text.substr(0, equals), {}};
  const std::string value = text.substr(equals + 1);
  try {
    if (!detail::line_of_deep_nesting(value)) assignment.holder = toml::parse("value = " + value);
  } catch (const toml::parse_error&) {
    assignment.holder.clear();
  }
  // A text needs no quotes on a command line, where the shell takes them off.
  if (assignment.holder.size() != 1) assignment.holder = toml::table{{"value", value}};
  return assignment;
}

Document::Document(std::string name, std::string_view text, std::vector<Assignment> assignments,
                   Lines lines)
    : name_(std::move(name)),
      lines_(lines),
      root_(parse_text(text, name_)),
      assignments_(std::move(assignments)) {
  std::set<std::string> paths;
  for (Assignment& assignment : assignments_) {
    assignment.path = with_index(root_, assignment);
    if (paths.insert(assignment.path).second) continue;
    throw DefinitionError(
        fmt::format("{}: {} is set more than once", assignment.origin, assignment.path));
  }
}

const toml::node* Document::value_at(const std::string& path) const {
  for (auto it = assignments_.rbegin(); it != assignments_.rend(); ++it) {
    if (it->path == path) return it->holder.get("value");
  }
  return toml::at_path(root_, path).node();
}

const toml::node* Document::find(const std::string& path) {
  keys_.insert(path);
  return value_at(path);
}

bool Document::is_assigned(const std::string& path) const {
  return std::ranges::find(assignments_, path, &Assignment::path) != assignments_.end();
}

bool Document::has_table(const std::string& path) const {
  const auto is_below = [&](const Assignment& of) { return of.path.starts_with(path + "."); };
  return value_at(path) != nullptr || std::ranges::any_of(assignments_, is_below);
}

std::optional<std::size_t> Document::num_tables(const std::string& path, std::size_t count_max) {
  const toml::node* const found = value_at(path);
  const toml::array* const list = found == nullptr ? nullptr : found->as_array();
  const auto is_table = [](const toml::node& entry) { return entry.is_table(); };
  const bool are_tables = list != nullptr && std::ranges::all_of(*list, is_table);
  // The keys are those of the tables; where there is none, the list itself is one.
  if (are_tables && !list->empty() && list->size() <= count_max) return list->size();
  keys_.insert(path);
  if (are_tables && list->size() > count_max) {
    refusals_.push_back({place_of(path), fmt::format("{} = {} tables", path, list->size()), path,
                         fmt::format("must be at most {}", count_max)});
    return std::nullopt;
  }
  if (are_tables) return 0;
  if (found != nullptr) refuse(path, "must be a list of tables");
  return std::nullopt;
}

bool Document::read(const std::string& path, double& value, const Range& range) {
  const toml::node* const found = find(path);
  if (found == nullptr) return false;
  if (!found->is_number()) {
    refuse(path, "must be a number");
    return false;
  }
  const double number = found->is_integer() ? static_cast<double>(found->as_integer()->get())
                                            : found->as_floating_point()->get();
  if (!range.contains(number)) {
    refuse(path, std::isfinite(number) ? range.rule() : range::any.rule());
    return false;
  }
  value = number;
  return true;
}

template <typename Value>
const toml::value<Value>* Document::find_value(const std::string& path, std::string_view rule) {
  const toml::node* const found = find(path);
  const toml::value<Value>* const value = found == nullptr ? nullptr : found->as<Value>();
  if (found != nullptr && value == nullptr) refuse(path, rule);
  return value;
}

bool Document::read(const std::string& path, std::int64_t& value, const Range& range) {
  const auto* const found =
      find_value<std::int64_t>(path, "must be a whole number without point or exponent");
  if (found == nullptr) return false;
  if (!range.contains(static_cast<double>(found->get()))) {
    refuse(path, range.rule());
    return false;
  }
  value = found->get();
  return true;
}

bool Document::read(const std::string& path, std::uint64_t& value, const Range& range) {
  std::int64_t wide = 0;
  if (!read(path, wide, range)) return false;
  value = static_cast<std::uint64_t>(wide);
  return true;
}

bool Document::read(const std::string& path, int& value) {
  std::int64_t wide = 0;
  using limits = std::numeric_limits<int>;
  if (!read(path, wide, range::between(limits::min(), limits::max()))) return false;
  value = static_cast<int>(wide);
  return true;
}

bool Document::read(const std::string& path, bool& value) {
  const auto* const found = find_value<bool>(path, "must be true or false");
  if (found != nullptr) value = found->get();
  return found != nullptr;
}

bool Document::read(const std::string& path, std::string& value) {
  const auto* const found = find_value<std::string>(path, "must be a text");
  if (found != nullptr) value = found->get();
  return found != nullptr;
}

std::optional<std::size_t> Document::read_choice(const std::string& path,
                                                 std::span<const std::string_view> names) {
  const toml::node* const found = find(path);
  if (found == nullptr) return std::nullopt;
  if (const auto* const text = found->as_string()) {
    const auto match = std::ranges::find(names, std::string_view(text->get()));
    if (match != names.end()) return static_cast<std::size_t>(match - names.begin());
  }
  refuse(path, "must be " + alternatives(names));
  return std::nullopt;
}

Document::Place Document::place_of(std::string path) const {
  for (; !path.empty(); path = parent_of(path)) {
    for (std::size_t i = assignments_.size(); i > 0; --i) {
      if (assignments_[i - 1].path == path) return {.assignment = i};
    }
    if (const toml::node* const found = toml::at_path(root_, path).node()) {
      const toml::source_position& begin = found->source().begin;
      return {.assignment = 0, .line = begin.line, .column = begin.column};
    }
  }
  return {};
}

std::string Document::prefix(const Place& place) const {
  if (place.assignment != 0) return assignments_[place.assignment - 1].origin + ": ";
  const bool has_line = place.line != 0 && lines_ == Lines::named;
  return has_line ? fmt::format("{}:{}: ", name_, place.line) : name_ + ": ";
}

void Document::refuse(const std::string& path, std::string_view rule) {
  const toml::node* const found = value_at(path);
  PROOFMASS_EXPECT(found != nullptr);
  refusals_.push_back(
      {place_of(path), fmt::format("{} = {}", path, text_of(*found)), path, std::string(rule)});
}

void Document::refuse_absence(const std::string& path, std::string_view rule) {
  refusals_.push_back({place_of(path), path + " is missing", path, std::string(rule), true});
}

bool Document::leads_to_keys(const std::string& path) const {
  const auto has_prefix = [this](const std::string& prefix) {
    const auto next = keys_.lower_bound(prefix);
    return next != keys_.end() && next->starts_with(prefix);
  };
  return path.empty() || has_prefix(path + ".") || has_prefix(path + "[");
}

void Document::refuse_unknown(const toml::node& content, const std::string& path,
                              std::optional<Refusal>& first) const {
  const toml::source_position& begin = content.source().begin;
  const Place place{.assignment = 0, .line = begin.line, .column = begin.column};
  // Only the first is kept: hostile texts may have very many.
  if (first && first->place <= place) return;
  first = {place, fmt::format("{} = {}", shortened(path), text_of(content)), path,
           leads_to_keys(path) ? "must be a table" : ""};
}

void Document::find_unknown_keys(const toml::node& content, const std::string& path,
                                 std::optional<Refusal>& first) const {
  if (keys_.contains(path)) return;
  // Below a path that is longer than any key there is nothing to be found.
  if (path.size() > shown_path_length_max) return refuse_unknown(content, path, first);
  const toml::table* const table = content.as_table();
  if (table != nullptr && (!table->empty() || leads_to_keys(path))) {
    for (const auto& [key, child] : *table) {
      find_unknown_keys(child, path_of(path, key.str()), first);
    }
    return;
  }
  const toml::array* const list = content.as_array();
  if (list != nullptr && leads_to_keys(path)) {
    for (std::size_t i = 0; i < list->size(); ++i) {
      find_unknown_keys((*list)[i], fmt::format("{}[{}]", path, i), first);
    }
    return;
  }
  refuse_unknown(content, path, first);
}

DefinitionError Document::error_of(const Refusal& refusal) const {
  std::string rule = refusal.rule;
  if (rule.empty()) {
    const std::optional<std::string> nearest = nearest_name(refusal.path, keys_);
    rule = nearest ? "unknown key; nearest is " + *nearest : "unknown key";
  }
  // An assignment shows key and value already.
  const bool is_assigned = refusal.place.assignment != 0 &&
                           assignments_[refusal.place.assignment - 1].path == refusal.path;
  const std::string text = is_assigned ? rule : fmt::format("{} ({})", refusal.subject, rule);
  return DefinitionError(prefix(refusal.place) + text);
}

void Document::check() const {
  std::optional<Refusal> first;
  const auto earliest = std::ranges::min_element(refusals_, {}, &Refusal::place);
  if (earliest != refusals_.end()) first = *earliest;
  std::optional<Refusal> unknown;
  find_unknown_keys(root_, "", unknown);
  // What is missing may stand there, misspelled.
  const auto is_meant = [&] { return nearest_name(unknown->path, keys_) == first->path; };
  if (unknown && (!first || unknown->place < first->place || (first->is_absence && is_meant()))) {
    first = unknown;
  }
  for (std::size_t i = 0; i < assignments_.size(); ++i) {
    const Place place{.assignment = i + 1};
    if (keys_.contains(assignments_[i].path) || (first && first->place <= place)) continue;
    first = {place, assignments_[i].path, assignments_[i].path, ""};
  }
  if (first) throw error_of(*first);
}

DefinitionError Document::located(const ConfigError& error) const {
  const std::string& field = error.field();
  const std::string table = parent_of(field), key = field.substr(field.rfind('.') + 1);
  const std::string rest = std::string(error.what()).substr(field.size());
  // A table that holds for all of its elements has `mean` where the field is `x.mean`. Covariances
  // are checked as the correlations that they become.
  for (const std::string_view name : {std::string_view(key), std::string_view("covariances")}) {
    for (const std::string& holder : {table, parent_of(table)}) {
      const std::string written = path_of(holder, name);
      if (value_at(written) == nullptr) continue;
      const std::string_view remark = name == key ? "" : " as correlations";
      return DefinitionError(
          fmt::format("{}{}{}{}", prefix(place_of(written)), written, remark, rest));
    }
    if (key != "correlations") break;
  }
  return DefinitionError(prefix(place_of(field)) + error.what());
}

}  // namespace proofmass
