#include "proto/text/event.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "proto/text/visible_text.hpp"
#include "tests/proto/text/hostile_values.hpp"

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

}  // namespace
}  // namespace proofmass::wire
