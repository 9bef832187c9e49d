#include "core/campaign/expression.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <cstddef>
#include <string>

#include "core/error.hpp"

namespace proofmass {
namespace {

bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// x multiplied by itself: std::pow may round differently from one processor to another.
double whole_power(double x, int exponent) {
  double power = 1.0;
  for (int i = 0; i < std::abs(exponent); ++i) power *= x;
  return exponent < 0 ? 1.0 / power : power;
}

constexpr std::string_view square_root_name = "sqrt", power_name = "pow";

/// Reads and evaluates from left to right, one function for each level of precedence.
class Evaluation {
 public:
  Evaluation(std::string_view text, const std::function<double(std::string_view)>& value_of)
      : text_(text), value_of_(value_of) {}

  double run() {
    const double value = sum();
    if (next() != '\0') refuse("must be an operator or the end");
    return value;
  }

 private:
  static constexpr int depth_max = 32;
  static constexpr int exponent_max = 16;

  [[noreturn]] void refuse(std::string_view rule) const {
    throw InvalidArgument(fmt::format("character {} {}", position_ + 1, rule));
  }

  /// The next character that is no blank; 0 at the end.
  char next() {
    while (position_ < text_.size() && text_[position_] == ' ') ++position_;
    return position_ < text_.size() ? text_[position_] : '\0';
  }

  bool skip(char c) {
    if (next() != c) return false;
    ++position_;
    return true;
  }

  void expect(char c) {
    if (!skip(c)) refuse(fmt::format("must be {}", c));
  }

  double sum() {
    double value = product();
    while (true) {
      if (skip('+')) {
        value += product();
      } else if (skip('-')) {
        value -= product();
      } else {
        return value;
      }
    }
  }

  double product() {
    double value = factor();
    while (true) {
      if (skip('*')) {
        value *= factor();
      } else if (skip('/')) {
        value /= factor();
      } else {
        return value;
      }
    }
  }

  double factor() {
    if (++depth_ > depth_max) refuse(fmt::format("is nested deeper than {} levels", depth_max));
    const double value = skip('-') ? -factor() : operand();
    --depth_;
    return value;
  }

  double operand() {
    const char first = next();
    if (is_letter(first)) return named();
    if (is_digit(first) || first == '.') return number<double>();
    if (!skip('(')) refuse("must be a number, a quantity, sqrt, pow, - or (");
    const double value = sum();
    expect(')');
    return value;
  }

  template <typename Number>
  Number number() {
    Number value{};
    const auto [end, error] =
        std::from_chars(text_.data() + position_, text_.data() + text_.size(), value);
    if (error != std::errc{}) refuse("must be a number that a double can hold");
    position_ = static_cast<std::size_t>(end - text_.data());
    return value;
  }

  double named() {
    const std::size_t first = position_;
    while (position_ < text_.size() && (is_letter(text_[position_]) || is_digit(text_[position_]) ||
                                        text_[position_] == '_' || text_[position_] == '.')) {
      ++position_;
    }
    const std::string_view name = text_.substr(first, position_ - first);
    if (!is_function(name)) return value_of_(name);
    expect('(');
    const double argument = sum();
    const double value = name == square_root_name ? std::sqrt(argument) : power_of(argument);
    expect(')');
    return value;
  }

  double power_of(double argument) {
    expect(',');
    (void)next();
    const std::size_t first = position_;
    const auto whole = number<int>();
    if (whole >= -exponent_max && whole <= exponent_max) return whole_power(argument, whole);
    position_ = first;
    refuse(fmt::format("must be a whole number from {} to {}", -exponent_max, exponent_max));
  }

  std::string_view text_;
  const std::function<double(std::string_view)>& value_of_;
  std::size_t position_ = 0;
  int depth_ = 0;
};

}  // namespace

bool is_function(std::string_view name) { return name == square_root_name || name == power_name; }

double evaluate_expression(std::string_view text,
                           const std::function<double(std::string_view name)>& value_of) {
  return Evaluation(text, value_of).run();
}

}  // namespace proofmass
