#include "proto/text/event.hpp"

#include <fmt/format.h>

#include "proto/text/visible_text.hpp"

namespace proofmass::wire {
namespace {

std::string quoted(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '"' || c == '\\') escaped += '\\';
    escaped += c;
  }
  return '"' + visible_text(escaped) + '"';
}

/// True if neither a quote nor a character that must not reach a terminal is in it.
bool is_plain(std::string_view text) {
  return text.find('"') == std::string_view::npos && visible_text(text) == text;
}

std::string value_text(const std::string& text) {
  return is_plain(text) && text.find(' ') == std::string::npos ? text : quoted(text);
}
std::string value_text(std::uint64_t count) { return fmt::format("{}", count); }
std::string value_text(double number) { return fmt::format("{:#}", number); }

/// No word of it may look like a field, as `a=b` does and `=` or `=b` do not.
std::string remark_text(std::string_view remark) {
  std::string escaped;
  for (const char c : remark) {
    const bool begins_word = escaped.empty() || escaped.back() == ' ';
    if (c == '=' && !begins_word) {
      escaped += "\\u003d";
    } else {
      if (c == '\\') escaped += '\\';
      escaped += c;
    }
  }
  return visible_text(escaped);
}

std::string field_text(const Field& field) {
  const auto* const text = std::get_if<std::string>(&field.value);
  if (field.name.empty() && text != nullptr) return remark_text(*text);
  const std::string value =
      field.is_quoted && text != nullptr
          ? quoted(*text)
          : std::visit([](const auto& content) { return value_text(content); }, field.value);
  return fmt::format("{}={}", field.name, value);
}

}  // namespace

Field Field::reason(std::string_view text) {
  Field field("reason", text);
  field.is_quoted = true;
  return field;
}

Field Field::remark(std::string_view text) { return {"", text}; }

std::string to_text(std::span<const Field> fields) {
  std::string line;
  for (const Field& field : fields) {
    const std::string text = field_text(field);
    if (!line.empty() && !text.empty()) line += ' ';
    line += text;
  }
  return line;
}

std::string to_text(const Event& event) {
  const std::string fields = to_text(event.fields);
  return fields.empty() ? std::string(event.kind) : fmt::format("{} {}", event.kind, fields);
}

}  // namespace proofmass::wire
