#include "core/definition/nesting.hpp"

#include <algorithm>

namespace proofmass::detail {
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
