#pragma once

#include <regex>

#include "tests/test.hpp"

namespace proofmass::test {

/// Why a text is no well-formed XML as far as these charts use it (elements, attributes in double
/// quotes, entities of five names and numbers); empty if it is.
inline std::string malformed_part(const std::string& text) {
  static const std::regex tag(
      "<(/?)([a-zA-Z][a-zA-Z0-9]*)((?: [a-zA-Z-]+=\"[^\"<]*\")*)(/?)>|[^<]+|<");
  static const std::regex entities("&(?!(amp|lt|gt|quot|apos|#[0-9]+);)");
  std::vector<std::string> open;
  for (auto it = std::sregex_iterator(text.begin(), text.end(), tag); it != std::sregex_iterator();
       ++it) {
    const std::smatch& match = *it;
    if (std::regex_search(match.str(), entities)) return "entity in " + match.str();
    if (match.str() == "<") return "no tag at " + text.substr(std::size_t(match.position()), 40);
    if (!match[2].matched) continue;
    if (match[1].length() > 0) {
      if (open.empty() || open.back() != match[2].str()) return "end of " + match[2].str();
      open.pop_back();
    } else if (match[4].length() == 0) {
      open.push_back(match[2].str());
    }
  }
  return open.empty() ? "" : "without end: " + open.back();
}

/// The elements of a name with an attribute of this value, as their whole tags.
inline std::vector<std::string> tags_of(const std::string& text, const std::string& pattern) {
  const std::regex wanted(pattern);
  std::vector<std::string> tags;
  for (auto it = std::sregex_iterator(text.begin(), text.end(), wanted);
       it != std::sregex_iterator(); ++it) {
    tags.push_back(it->str());
  }
  return tags;
}

/// An attribute's value as a number.
inline double number_of(const std::string& tag, const std::string& attribute) {
  std::smatch match;
  const std::regex wanted(" " + attribute + "=\"([^\"]*)\"");
  if (!std::regex_search(tag, match, wanted)) {
    ADD_FAILURE() << attribute << " in " << tag;
    return 0.0;
  }
  return std::stod(match[1].str());
}

}  // namespace proofmass::test
