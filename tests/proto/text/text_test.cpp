#include "proto/text/event.hpp"
#include "proto/text/visible_text.hpp"
#include "tests/proto/text/hostile_values.hpp"
#include "tests/test.hpp"

namespace proofmass::wire {
namespace {

/// What a reader finds in a line, by the rule that to_text() states and without its source.
struct Parsed {
  std::vector<std::pair<std::string, std::string>> fields;
  std::string remarks;
};

std::string utf8(unsigned code) {
  const auto byte = [](unsigned value) { return static_cast<char>(value); };
  if (code < 0x80) return {byte(code)};
  if (code < 0x800) return {byte(0xc0 | (code >> 6)), byte(0x80 | (code & 0x3f))};
  return {byte(0xe0 | (code >> 12)), byte(0x80 | ((code >> 6) & 0x3f)), byte(0x80 | (code & 0x3f))};
}

std::string unescaped(const std::string& text) {
  std::string plain;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '\\') {
      plain += text[i];
      continue;
    }
    const char kind = text.at(++i);
    const std::size_t num_digits = kind == 'u' ? 4 : kind == 'x' ? 2 : 0;
    const std::string digits = text.substr(i + 1, num_digits);
    i += num_digits;
    if (kind == 'u') plain += utf8(static_cast<unsigned>(std::stoul(digits, nullptr, 16)));
    if (kind == 'x') plain += static_cast<char>(std::stoul(digits, nullptr, 16));
    if (kind == 'n') plain += '\n';
    if (kind == 'r') plain += '\r';
    if (kind == 't') plain += '\t';
    if (kind == '"' || kind == '\\') plain += kind;
  }
  return plain;
}

/// Takes what is in quotes off the line, which begins with the first quote.
std::string take_quoted(std::string& line) {
  std::size_t end = 1;
  for (; line.at(end) != '"'; ++end) {
    if (line[end] == '\\') ++end;
  }
  const std::string text = unescaped(line.substr(1, end - 1));
  line.erase(0, end + 1);
  return text;
}

/// Takes the text before the next of these characters off the line.
std::string take_until(std::string& line, const char* ends) {
  const std::string text = line.substr(0, line.find_first_of(ends));
  line.erase(0, text.size());
  return text;
}

std::string take_value(std::string& line) {
  return line.starts_with('"') ? take_quoted(line) : take_until(line, " ");
}

Parsed parsed(std::string line) {
  Parsed found;
  for (; !line.empty(); line.erase(0, line.starts_with(' ') ? 1 : 0)) {
    const std::size_t equals = line.substr(0, line.find(' ')).find('=');
    if (equals == std::string::npos || equals == 0) {
      if (!found.remarks.empty()) found.remarks += ' ';
      found.remarks += unescaped(take_until(line, " "));
    } else {
      const std::string name = take_until(line, "=");
      line.erase(0, 1);
      found.fields.emplace_back(name, take_value(line));
    }
  }
  return found;
}

TEST(EventText, IsWhatPeopleKnow) {
  EXPECT_EQ(to_text({.kind = "connected"}), "connected");
  EXPECT_EQ(to_text({.kind = "runs_lost",
                     .fields = {{"worker", 7U}, {"runs", "120..183"}, {"reason", "silent"}}}),
            "runs_lost worker=7 runs=120..183 reason=silent");
  EXPECT_EQ(to_text({.kind = "refused",
                     .fields = {Field::reason("full"), Field::remark("(asks again)")}}),
            "refused reason=\"full\" (asks again)");
  EXPECT_EQ(to_text({.kind = "worker_refused",
                     .fields = {{"name", "w"}, Field::remark("host = \"bad\" (crashed)")}}),
            "worker_refused name=w host = \"bad\" (crashed)");
  EXPECT_EQ(to_text({.kind = "worker_crashed",
                     .fields = {{"signal", 11U},
                                Field::remark("(Segmentation fault)"),
                                {"restart_in_s", 1.0}}}),
            "worker_crashed signal=11 (Segmentation fault) restart_in_s=1.0");
  // Keys in Z85, addresses and empty values are as they are.
  const Fields bare{{"key", "a=b.-:+^!/*?&<>()[]{}@%$#"}, {"name", ""}, {"file", "a\\b"}};
  EXPECT_EQ(to_text(bare), "key=a=b.-:+^!/*?&<>()[]{}@%$# name= file=a\\b");
}

TEST(EventText, WritesNumbersShortAndExactly) {
  EXPECT_EQ(to_text(Fields{{"a", 0.1}, {"b", 2.5}, {"c", 30.0}}), "a=0.1 b=2.5 c=30.0");
  EXPECT_EQ(to_text(Fields{{"a", ~std::uint64_t{0}}}), "a=18446744073709551615");
}

TEST(EventText, CanBeTakenApartWhateverAFieldHolds) {
  for (const std::string_view hostile : test::hostile_values) {
    const std::string value(hostile);
    const std::string line = to_text(Fields{{"before", 1U},
                                            {"value", value},
                                            Field::reason(value),
                                            Field::remark(value),
                                            {"after", 2U}});
    const Parsed found = parsed(line);
    const std::vector<std::pair<std::string, std::string>> expected{
        {"before", "1"}, {"value", value}, {"reason", value}, {"after", "2"}};
    EXPECT_EQ(found.fields, expected) << line;
    EXPECT_EQ(found.remarks, value) << line;
    EXPECT_EQ(visible_text(line), line);
  }
}

TEST(EventText, KeepsBytesThatAreNotUtf8) {
  const std::string line = to_text(Fields{Field::reason("\xff\xc0")});
  EXPECT_EQ(line, "reason=\"\\xff\\xc0\"");
  EXPECT_EQ(parsed(line).fields.at(0).second, "\xff\xc0");
}

TEST(VisibleText, ShowsWhatWouldSteerATerminal) {
  EXPECT_EQ(visible_text("a\tb\nc\rd"), "a\\tb\\nc\\rd");
  EXPECT_EQ(visible_text("\x1b[31mred\x7f"), "\\u001b[31mred\\u007f");
  EXPECT_EQ(visible_text("\xc2\x9b"), "\\u009b");    // CSI as one character.
  EXPECT_EQ(visible_text("a\u202eb"), "a\\u202eb");  // Turns the direction of writing.
  EXPECT_EQ(visible_text("s²/m Δ 測"), "s²/m Δ 測");
}

TEST(VisibleText, ShowsBytesThatAreNotUtf8) {
  EXPECT_EQ(visible_text("\xff"), "\\xff");
  EXPECT_EQ(visible_text("\xe6\xb8"), "\\xe6\\xb8");                    // Ends within a character.
  EXPECT_EQ(visible_text("\xc0\xaf"), "\\xc0\\xaf");                    // Longer than need be.
  EXPECT_EQ(visible_text("\xed\xa0\x80"), "\\xed\\xa0\\x80");           // Half of a surrogate pair.
  EXPECT_EQ(visible_text("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80");  // Beyond Unicode.
}

TEST(VisibleText, KeepsTheEndsOfLinesOfLongerText) {
  EXPECT_EQ(visible_lines("one\r\n\ntwo\x1b\n"), "one\\r\n\ntwo\\u001b\n");
  EXPECT_EQ(visible_lines(""), "");
}

TEST(MarkupText, CannotLeaveItsPlaceInADocument) {
  EXPECT_EQ(markup_text("<script>alert('1')</script>"),
            "&lt;script&gt;alert(&#39;1&#39;)&lt;/script&gt;");
  EXPECT_EQ(markup_text("\" onload=\"x"), "&quot; onload=&quot;x");
  EXPECT_EQ(markup_text("&lt;"), "&amp;lt;");
  EXPECT_EQ(markup_text("Δx\n\x1b[31m\xff"), "Δx\\n\\u001b[31m\\xff");
}

TEST(DisplayWidth, CountsColumnsOfATerminal) {
  EXPECT_EQ(display_width("a_c11·Δx"), 8u);
  EXPECT_EQ(display_width("│─−µ"), 4u);
  EXPECT_EQ(display_width("s²/m"), 4u);
  EXPECT_EQ(display_width("測定"), 4u);
  EXPECT_EQ(display_width("e\u0301"), 1u);  // A combining accent.
  EXPECT_EQ(display_width("🛰"), 2u);
  EXPECT_EQ(display_width(""), 0u);
}

TEST(ShortenedText, IsCutBetweenCharacters) {
  EXPECT_EQ(shortened("calibration", 11), "calibration");
  EXPECT_EQ(shortened("calibration", 6), "calib…");
  EXPECT_EQ(shortened("測定値", 6), "測定値");
  EXPECT_EQ(shortened("測定値", 5), "測定…");
  EXPECT_EQ(shortened("測定値", 4), "測…");
  EXPECT_EQ(shortened("─────", 3), "──…");
  EXPECT_EQ(shortened("ab", 1), "…");
}

}  // namespace
}  // namespace proofmass::wire
