#include "coordinator/cli/sweep_plan.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "coordinator/cli/program.hpp"
#include "coordinator/store/sha256.hpp"
#include "coordinator/table/terminal_table.hpp"

namespace proofmass::coordinator {
namespace {

[[noreturn]] void refuse_varied(std::string_view text, std::string_view rule) {
  throw UsageError(fmt::format("vary = {} ({})", text, rule));
}

std::string_view without_blanks(std::string_view text) {
  const std::size_t first = text.find_first_not_of(' ');
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(' ') + 1 - first);
}

/// Where a list of values is cut: at commas that are in no array, table or string of TOML.
class ValueScanner {
 public:
  [[nodiscard]] bool ends_value(char character) {
    if (quote_ != 0) {
      const bool ends_string = character == quote_ && !is_escaped_;
      is_escaped_ = quote_ == '"' && character == '\\' && !is_escaped_;
      if (ends_string) quote_ = 0;
      return false;
    }
    if (character == '"' || character == '\'') quote_ = character;
    if (character == '[' || character == '{') ++depth_;
    if (character == ']' || character == '}') --depth_;
    return character == ',' && depth_ == 0;
  }

 private:
  char quote_ = 0;
  bool is_escaped_ = false;
  int depth_ = 0;
};

std::vector<std::string> values_in(std::string_view list) {
  std::vector<std::string> values;
  ValueScanner scanner;
  std::size_t begin = 0;
  for (std::size_t i = 0; i <= list.size(); ++i) {
    if (i < list.size() && !scanner.ends_value(list[i])) continue;
    values.emplace_back(without_blanks(list.substr(begin, i - begin)));
    begin = i + 1;
  }
  return values;
}

bool is_plain(char character) {
  constexpr std::string_view others = ".,=+-_";
  return (character >= '0' && character <= '9') || (character >= 'a' && character <= 'z') ||
         (character >= 'A' && character <= 'Z') || others.find(character) != std::string_view::npos;
}

}  // namespace

VariedKey parse_varied(std::string_view text) {
  const std::size_t equals = text.find('=');
  const std::string_view key = without_blanks(text.substr(0, equals));
  if (equals == std::string_view::npos || key.empty()) {
    refuse_varied(text, "must be KEY=VALUE,VALUE,...");
  }
  VariedKey varied{.key = std::string(key), .values = values_in(text.substr(equals + 1))};
  for (std::size_t i = 0; i < varied.values.size(); ++i) {
    const std::string& value = varied.values[i];
    if (value.empty()) refuse_varied(text, "must be KEY=VALUE,VALUE,...");
    if (std::ranges::count(varied.values, value) > 1) {
      refuse_varied(text, fmt::format("has the value {} twice", value));
    }
  }
  return varied;
}

std::vector<SweptValues> combinations(std::span<const VariedKey> keys) {
  std::vector<SweptValues> all(1);
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const auto& [key, values] = keys[i];
    if (std::ranges::count(keys, key, &VariedKey::key) > 1) {
      throw UsageError(fmt::format("vary = {} (is given twice)", key));
    }
    if (values.size() > num_swept_max / all.size()) {
      throw UsageError(fmt::format("vary = {} (makes more than {} campaigns)", key, num_swept_max));
    }
    std::vector<SweptValues> longer;
    for (const SweptValues& before : all) {
      for (const std::string& value : values) {
        longer.push_back(before);
        longer.back().emplace_back(key, value);
      }
    }
    all = std::move(longer);
  }
  if (all.size() < 2) throw UsageError("vary = (must make at least two campaigns)");
  return all;
}

std::string text_of(const SweptValues& values) {
  std::string text;
  for (const auto& [key, value] : values) {
    text += fmt::format("{}{}={}", text.empty() ? "" : ",", key, value);
  }
  return text;
}

std::string sweep_file_name(std::string_view stem, const SweptValues& values) {
  constexpr std::size_t size_max = 200, digest_size = 12;
  // A quoted and a bare text are the same value.
  std::string text = text_of(values);
  std::erase_if(text, [](char character) { return character == '"' || character == '\''; });
  std::string plain = text;
  std::ranges::replace_if(
      plain, [](char character) { return !is_plain(character); }, '_');
  std::string name = fmt::format("{}-{}", stem, plain);
  if (plain != text || name.size() > size_max) {
    Sha256 hash;
    hash.add_bytes(text);
    name = fmt::format("{}-{}", name.substr(0, size_max), hash.finish().substr(0, digest_size));
  }
  return name + ".db";
}

MemberNames sweep_names(std::span<const SweptValues> campaigns) {
  constexpr std::size_t columns_max = 15;
  MemberNames names;
  bool are_short = true;
  for (const auto& [key, value] : campaigns.front()) {
    names.title += (names.title.empty() ? "" : ",") + key;
  }
  for (const SweptValues& values : campaigns) {
    std::string name;
    for (const auto& [key, value] : values) name += (name.empty() ? "" : ",") + value;
    are_short = are_short && display_width(name) <= columns_max;
    names.names.push_back(std::move(name));
  }
  if (are_short && display_width(names.title) <= columns_max) return names;
  return lettered(campaigns.size());
}

}  // namespace proofmass::coordinator
