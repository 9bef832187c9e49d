#pragma once

#include <concepts>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

namespace proofmass::wire {

/// How much a person should care; *error* means that somebody must act.
enum class Severity : std::uint8_t { info, warning, error };

/// One fact about an event, such as `worker=7`. Values are kept as they are, whatever a file or a
/// peer has put into them: escaping is the business of what writes them.
struct Field {
  /// A name, a range of runs, a word of a list of constants.
  Field(std::string_view named, std::string_view text) : name(named), value(std::string(text)) {}
  Field(std::string_view named, std::unsigned_integral auto count)
      : name(named), value(std::uint64_t{count}) {}
  Field(std::string_view named, std::floating_point auto number)
      : name(named), value(double{number}) {}

  /// Why something happened, in words; always in quotes.
  [[nodiscard]] static Field reason(std::string_view text);
  /// What people should know beside the values, in words; has no name.
  [[nodiscard]] static Field remark(std::string_view text);

  std::string_view name;  ///< A literal that no other field of the event has; empty: a remark.
  std::variant<std::string, std::uint64_t, double> value;
  bool is_quoted = false;  ///< Even if the value needs no quotes.
};

using Fields = std::vector<Field>;

/// Something that happened: one line of a log.
struct Event {
  [[nodiscard]] static Event info(std::string_view kind, Fields fields = {}) {
    return {Severity::info, kind, std::move(fields)};
  }
  [[nodiscard]] static Event warning(std::string_view kind, Fields fields = {}) {
    return {Severity::warning, kind, std::move(fields)};
  }
  [[nodiscard]] static Event error(std::string_view kind, Fields fields = {}) {
    return {Severity::error, kind, std::move(fields)};
  }

  Severity severity = Severity::info;
  std::string_view kind;  ///< A literal: `runs_lost`.
  Fields fields = {};
};

/// Told of all that happens.
using Log = std::function<void(const Event&)>;

/// The fields as they stand in logs for people and in the table `event`, for instance
/// `worker=7 runs=120..183 reason="told to stop" (asks again)`. The line can be taken apart again:
///
/// - A blank separates words unless it is in quotes.
/// - A word with a `=` that is not its first character is a field, `name=value`. The value is in
///   quotes if it has a blank, a quote or a character that visible_text() escapes; then a quote is
///   `\"` and a backslash `\\`, and the rest is written as visible_text() does.
/// - All other words are remarks. A backslash in one is `\\`, a `=` within a word is `\u003d`, and
///   the rest is written as visible_text() does.
[[nodiscard]] std::string to_text(std::span<const Field> fields);
/// The kind and the fields.
[[nodiscard]] std::string to_text(const Event& event);

}  // namespace proofmass::wire
