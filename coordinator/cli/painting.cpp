#include "coordinator/cli/painting.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstdlib>
#include <string>
#include <vector>

namespace proofmass::coordinator {
namespace {

std::string_view value_of_variable(const char* name) {
  const char* const value = std::getenv(name);
  return value == nullptr ? std::string_view() : value;
}

std::string in_tone(std::string_view text, Tone tone) {
  if (text.empty()) return {};
  const int colour = colour_of(tone);
  if (colour == 0) return fmt::format("\033[1m{}\033[0m", text);
  return fmt::format("\033[1;38;5;{}m{}\033[0m", colour, text);
}

/// A word that is painted where it follows the beginning of a line.
struct PaintedVerdict {
  std::string_view begin;  ///< Of the line; blanks may follow it.
  std::string_view word;
  Tone tone;
};

constexpr std::array painted_verdicts{
    PaintedVerdict{"Answer ", "not met", Tone::bad},
    PaintedVerdict{"Answer ", "met", Tone::good},
    PaintedVerdict{"Answer ", "undecided", Tone::bad},
};

/// Texts of lines that are painted as a whole.
constexpr std::array<std::string_view, 10> texts_of_trouble{
    "nothing can be stored: ",
    " given up: too many workers crashed",
    " given up, having crashed workers:",
    " without an estimate",
    " differ (none may)",
    " is in quarantine: too many workers crashed there",
    " in quarantine, is lent nothing: too many crashes on ",
    "not served, tried again: ",
    "proofmass: error: ",
    "; starting another",
};

/// The beginning of the line below a name that `list` cannot open.
constexpr std::string_view problem_begin = "  campaign database = ";

bool is_trouble(std::string_view line) {
  if (line.starts_with(problem_begin)) return true;
  for (const std::string_view text : texts_of_trouble) {
    if (line.find(text) != std::string_view::npos) return true;
  }
  return false;
}

/// ─ and ┼ alone, as table_rule() writes it.
bool is_rule(std::string_view line) {
  if (line.empty()) return false;
  while (!line.empty()) {
    if (!line.starts_with("─") && !line.starts_with("┼")) return false;
    line.remove_prefix(std::string_view("─").size());
  }
  return true;
}

/// Where the last word before the first vertical line begins and ends.
struct WordPlace {
  std::size_t begin = 0;
  std::size_t end = 0;
};

constexpr std::string_view vertical_line = "│";

WordPlace word_before_line(std::string_view line) {
  const std::size_t bar = line.find(vertical_line);
  if (bar == std::string_view::npos) return {};
  const std::size_t last = line.substr(0, bar).find_last_not_of(' ');
  if (last == std::string_view::npos) return {};
  const std::size_t blank = line.substr(0, last).find_last_of(' ');
  return {.begin = blank == std::string_view::npos ? 0 : blank + 1, .end = last + 1};
}

std::string_view word_at(std::string_view line, WordPlace place) {
  return line.substr(place.begin, place.end - place.begin);
}

std::string with_word_painted(std::string_view line, WordPlace place, Tone tone) {
  return std::string(line.substr(0, place.begin)) + in_tone(word_at(line, place), tone) +
         std::string(line.substr(place.end));
}

/// The stars of significant changes, each after a blank and at the end or before another blank.
std::string with_stars_painted(const std::string& line) {
  std::string text;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const bool is_star = line[i] == '*' && i > 0 && line[i - 1] == ' ' &&
                         (i + 1 == line.size() || line[i + 1] == ' ');
    text += is_star ? in_tone("*", Tone::changed) : line.substr(i, 1);
  }
  return text;
}

/// The verdict of a check of `verify`: `name  ok  finding`.
std::string with_check_painted(std::string_view line) {
  for (const auto& [word, tone] : {std::pair(std::string_view("FAILS"), Tone::bad),
                                   std::pair(std::string_view("ok"), Tone::good)}) {
    const std::size_t name_end = line.find(' ');
    if (name_end == std::string_view::npos || name_end == 0) continue;
    const std::size_t begin = line.find_first_not_of(' ', name_end);
    if (begin == std::string_view::npos || !line.substr(begin).starts_with(word)) continue;
    const std::size_t end = begin + word.size();
    if (end < line.size() && line.substr(end, 2) != "  " && line.substr(end) != " ") continue;
    return with_word_painted(line, {.begin = begin, .end = end}, tone);
  }
  return std::string(line);
}

std::string with_verdict_painted(std::string_view line) {
  for (const auto& [begin, word, tone] : painted_verdicts) {
    if (!line.starts_with(begin)) continue;
    const std::size_t place = line.find_first_not_of(' ', begin.size());
    if (place == std::string_view::npos || line.substr(place) != word) continue;
    return with_word_painted(line, {.begin = place, .end = line.size()}, tone);
  }
  return with_check_painted(line);
}

/// Paints line after line and knows in what kind of table it is.
class Painter {
 public:
  [[nodiscard]] std::string painted_line(std::string_view line, std::string_view next) {
    if (is_rule(next)) return begin_table(line);
    if (line.empty()) is_table_ = counts_beyond_ = false;
    if (is_rule(line)) return std::string(line);
    if (is_trouble(line)) return in_tone(line, Tone::bad);
    if (!is_table_) return with_verdict_painted(line);
    const WordPlace place = word_before_line(line);
    const std::string_view count = word_at(line, place);
    const bool is_beyond = counts_beyond_ && !count.empty() && count != "0" && count != "-";
    return with_stars_painted(is_beyond ? with_word_painted(line, place, Tone::bad)
                                        : std::string(line));
  }

 private:
  [[nodiscard]] std::string begin_table(std::string_view titles) {
    is_table_ = true;
    counts_beyond_ = word_at(titles, word_before_line(titles)) == "beyond";
    return in_tone(titles, Tone::heading);
  }

  bool is_table_ = false;
  bool counts_beyond_ = false;  ///< In the last column before the vertical line.
};

std::vector<std::string_view> lines_in(std::string_view text) {
  std::vector<std::string_view> lines;
  for (std::size_t end = 0; (end = text.find('\n')) != std::string_view::npos;) {
    lines.push_back(text.substr(0, end));
    text.remove_prefix(end + 1);
  }
  lines.push_back(text);  // What follows the last end of a line, usually nothing.
  return lines;
}

}  // namespace

int colour_of(Tone tone) {
  switch (tone) {
    case Tone::good:
      return 31;  // #0087af.
    case Tone::bad:
      return 130;  // #af5f00.
    case Tone::heading:
    case Tone::changed:
      break;
  }
  return 0;
}

bool takes_escapes(std::FILE* stream) {
  const std::string_view terminal = value_of_variable("TERM");
  return isatty(fileno(stream)) != 0 && !terminal.empty() && terminal != "dumb";
}

bool takes_paint(std::FILE* stream) {
  return takes_escapes(stream) && value_of_variable("NO_COLOR").empty();
}

std::string painted(std::string_view text) {
  const std::vector<std::string_view> lines = lines_in(text);
  Painter painter;
  std::string result;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::string_view next = i + 1 < lines.size() ? lines[i + 1] : std::string_view();
    result += painter.painted_line(lines[i], next);
    if (i + 1 < lines.size()) result += '\n';
  }
  return result;
}

}  // namespace proofmass::coordinator
