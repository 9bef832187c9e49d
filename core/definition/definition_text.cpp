#include "core/definition/definition_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace proofmass {

std::size_t edit_distance(std::string_view from, std::string_view to) {
  using Row = std::vector<std::size_t>;
  Row before_last(to.size() + 1), last(to.size() + 1), row(to.size() + 1);
  for (std::size_t j = 0; j <= to.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= from.size(); ++i) {
    before_last.swap(last);
    last.swap(row);
    row[0] = i;
    for (std::size_t j = 1; j <= to.size(); ++j) {
      const std::size_t replaced = last[j - 1] + (from[i - 1] == to[j - 1] ? 0 : 1);
      row[j] = std::min({replaced, last[j] + 1, row[j - 1] + 1});
      const bool swapped = i > 1 && j > 1 && from[i - 1] == to[j - 2] && from[i - 2] == to[j - 1];
      if (swapped) row[j] = std::min(row[j], before_last[j - 2] + 1);
    }
  }
  return row[to.size()];
}

std::optional<std::string> nearest_name(std::string_view name,
                                        const std::set<std::string>& candidates) {
  std::optional<std::string> nearest;
  std::size_t distance_min = std::max<std::size_t>(2, name.size() / 3) + 1;
  for (const std::string& candidate : candidates) {
    // Hostile names may be long: to compare them letter by letter would take minutes.
    if (name.size() >= candidate.size() + distance_min) continue;
    const std::size_t distance = edit_distance(name, candidate);
    if (distance >= distance_min) continue;
    distance_min = distance;
    nearest = candidate;
  }
  return nearest;
}

}  // namespace proofmass

namespace proofmass::detail {

std::string number_text(double value) {
  // Without a point TOML reads an integer, which has no negative zero.
  if (value == 0.0 && std::signbit(value)) return "-0.0";
  std::string text = fmt::format("{}", value);
  const std::size_t exponent = text.find('e');
  if (exponent == std::string::npos) return text;
  // `1e-05` and `1e+20` read better as `1e-5` and `1e20`.
  const std::size_t sign = exponent + 1;
  const std::size_t zeros_begin = sign + 1;
  const std::size_t zeros_end = text.find_first_not_of('0', zeros_begin);
  text.erase(zeros_begin, zeros_end - zeros_begin);
  if (text[sign] == '+') text.erase(sign, 1);
  return text;
}

std::string quoted_text(std::string_view text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      result += '\\';
      result += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      result += fmt::format("\\u{:04X}", static_cast<unsigned>(c));
    } else {
      result += c;
    }
  }
  return result + "\"";
}

std::string alternatives(std::span<const std::string_view> names) {
  std::string result;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) result += i + 1 == names.size() ? " or " : ", ";
    result += quoted_text(names[i]);
  }
  return result;
}

namespace {

/// Goes through a text of TOML. What it takes for texts and comments is what the TOML library takes
/// for them, up to the first place that is not TOML.
class NestingScanner {
 public:
  explicit NestingScanner(std::string_view text) : rest_(text) {}

  std::optional<std::size_t> run() {
    while (!rest_.empty()) {
      const char c = rest_.front();
      if (c == '"' || c == '\'') {
        skip_string(c);
      } else if (c == '#') {
        skip(std::min(rest_.find('\n'), rest_.size()));
      } else {
        skip(1);
        count(c);
        if (num_dots_ >= nesting_max || depth_ > nesting_max) return line_;
      }
    }
    return std::nullopt;
  }

 private:
  void count(char c) {
    if (c == '.') {
      ++num_dots_;
    } else if (std::string_view("=,[]{}\n").find(c) != std::string_view::npos) {
      num_dots_ = 0;
    }
    if (c == '[' || c == '{') ++depth_;
    if (c == ']' || c == '}') --depth_;
  }

  void skip(std::size_t size) {
    line_ += static_cast<std::size_t>(std::ranges::count(rest_.substr(0, size), '\n'));
    rest_.remove_prefix(size);
  }

  [[nodiscard]] std::size_t count_quotes(char quote, std::size_t count_max) const {
    const std::string_view next = rest_.substr(0, count_max);
    return std::min(next.find_first_not_of(quote), next.size());
  }

  void skip_string(char quote) {
    const std::size_t num_opening = count_quotes(quote, 3);
    if (num_opening == 2) return skip(2);
    const bool has_lines = num_opening == 3;
    skip(num_opening);
    while (!rest_.empty()) {
      const bool is_escape = rest_.front() == '\\' && quote == '"';
      if (count_quotes(quote, num_opening) == num_opening) break;
      if (rest_.front() == '\n' && !has_lines) return;
      skip(std::min<std::size_t>(is_escape ? 2 : 1, rest_.size()));
    }
    // A text of several lines may end with up to two quotes of its own.
    skip(count_quotes(quote, has_lines ? 5 : 1));
  }

  std::string_view rest_;
  std::size_t line_ = 1;
  int num_dots_ = 0;  // Since the last character that no key goes on behind.
  int depth_ = 0;
};

}  // namespace

std::optional<std::size_t> line_of_deep_nesting(std::string_view text) {
  return NestingScanner(text).run();
}

}  // namespace proofmass::detail
