#include "core/statistics/detail/phrase.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string>

#include "core/error.hpp"

namespace proofmass::detail {
namespace {

/// Symbols of quantities may have letters beyond ASCII: whoever types one is told the names.
bool is_word_part(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
         (c & 0x80) != 0;
}

std::string_view without_blanks_in_front(std::string_view text) {
  return text.substr(std::min(text.find_first_not_of(" \t"), text.size()));
}

}  // namespace

Phrase::Phrase(std::string_view field, std::string_view text, std::string_view form,
               std::span<const std::string_view> parameters)
    : field_(field),
      text_(text),
      form_(form),
      parameters_(parameters),
      rest_(without_blanks_in_front(text)) {}

std::string_view Phrase::word() {
  const auto end = std::ranges::find_if_not(rest_, is_word_part);
  const std::string_view word(rest_.begin(), end);
  if (word.empty()) refuse_form();
  rest_ = without_blanks_in_front(rest_.substr(word.size()));
  return word;
}

std::size_t Phrase::parameter() {
  const std::string_view name = word();
  const auto found = std::ranges::find(parameters_, name);
  if (found != parameters_.end()) return static_cast<std::size_t>(found - parameters_.begin());
  refuse(fmt::format("{} is no parameter; they are {}", name, fmt::join(parameters_, ", ")));
}

double Phrase::positive_number() {
  const std::string_view before = rest_;
  const double value = number();
  if (std::isfinite(value) && value > 0.0) return value;
  refuse(fmt::format("{} must be finite and > 0",
                     before.substr(0, static_cast<std::size_t>(before.find_first_of(" \t")))));
}

double Phrase::percentage() {
  const double percent = number();
  expect("%");
  if (percent > 0.0 && percent < 100.0) {
    // The number next to what is written: 99.99999/100 is not the one next to 0.9999999.
    const std::string digits = fmt::format("{}", percent);
    return digits.find('e') == digits.npos ? std::stod(digits + "e-2") : percent / 100.0;
  }
  refuse(fmt::format("{}% must be above 0% and below 100%", percent));
}

void Phrase::expect(std::string_view literal) {
  if (!takes_sign(literal)) refuse_form();
}

bool Phrase::takes_sign(std::string_view literal) {
  if (!rest_.starts_with(literal)) return false;
  rest_ = without_blanks_in_front(rest_.substr(literal.size()));
  return true;
}

bool Phrase::takes(std::string_view literal) {
  const auto end = std::ranges::find_if_not(rest_, is_word_part);
  if (std::string_view(rest_.begin(), end) != literal) return false;
  (void)word();
  return true;
}

bool Phrase::ends_with(std::string_view literal) const {
  const std::string_view text = rest_.substr(0, rest_.find_last_not_of(" \t") + 1);
  if (!text.ends_with(literal)) return false;
  const std::string_view before = text.substr(0, text.size() - literal.size());
  return before.empty() || !is_word_part(before.back());
}

void Phrase::expect_end() {
  if (!rest_.empty()) refuse_form();
}

void Phrase::refuse(std::string_view rule) const { throw ConfigError(field_, text_, rule); }

double Phrase::number() {
  double value = 0.0;
  const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
  if (error == std::errc::result_out_of_range) {
    refuse(fmt::format("{} is out of the range of numbers", std::string_view(rest_.data(), end)));
  }
  if (error != std::errc()) refuse_form();
  rest_ = without_blanks_in_front(rest_.substr(static_cast<std::size_t>(end - rest_.data())));
  return value;
}

void Phrase::refuse_form() const { refuse(fmt::format("must read \"{}\"", form_)); }

}  // namespace proofmass::detail
