#pragma once

#include <cstddef>
#include <span>
#include <string_view>

#include "core/statistics/requirement.hpp"

namespace proofmass::detail {

/// Reads a phrase that a user typed, such as `a_c12 < 9e-4 for 99% with 95%`, from left to right.
/// Blanks may stand between any two parts.
///
/// Each reader throws ConfigError, `field = phrase (rule)`, if something else follows.
class Phrase {
 public:
  /// @param form        How the whole phrase must read, for messages.
  /// @param parameters  Names of the parameters.
  /// All four must outlive the object.
  Phrase(std::string_view field, std::string_view text, std::string_view form,
         std::span<const std::string_view> parameters);

  /// Letters, digits and underscores.
  [[nodiscard]] std::string_view word();
  /// The name of a parameter, as its position among the names.
  [[nodiscard]] std::size_t parameter();
  /// A finite number > 0.
  [[nodiscard]] double positive_number();
  /// A number and `%`, as a fraction in (0, 1).
  [[nodiscard]] double percentage();
  /// This very text.
  void expect(std::string_view literal);
  /// True if this word comes next; it is then read.
  [[nodiscard]] bool takes(std::string_view literal);
  /// True if this text comes next, a sign; it is then read.
  [[nodiscard]] bool takes_sign(std::string_view literal);
  /// True if this word is the last one of the phrase.
  [[nodiscard]] bool ends_with(std::string_view literal) const;
  void expect_end();

  [[noreturn]] void refuse(std::string_view rule) const;

 private:
  [[nodiscard]] double number();
  [[noreturn]] void refuse_form() const;

  std::string_view field_, text_, form_;
  std::span<const std::string_view> parameters_;
  std::string_view rest_;  ///< What is not yet read, without blanks in front.
};

/// Reads a requirement from the front of a phrase; see parse_requirement(), whose source defines
/// it.
[[nodiscard]] Requirement read_requirement(Phrase& phrase);

}  // namespace proofmass::detail
