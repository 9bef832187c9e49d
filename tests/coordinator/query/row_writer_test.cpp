#include "coordinator/query/row_writer.hpp"

#include <nlohmann/json.hpp>

#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using CellRow = std::vector<Value>;
constexpr Value null{};
constexpr double infinity = std::numeric_limits<double>::infinity();

Value integer(std::int64_t value) { return value; }
Value text(std::string_view value) { return value; }

std::string written(RowFormat format, const std::vector<std::string>& columns,
                    const std::vector<CellRow>& rows, const TableLimits& limits = {}) {
  std::string out;
  const auto writer =
      make_row_writer(format, limits, [&](std::string_view piece) { out += piece; });
  writer->begin(columns);
  for (const CellRow& row : rows) {
    if (!writer->row(row)) break;
  }
  writer->end();
  return out;
}

TEST(CellText, ReadsBackToTheSameBits) {
  std::uint64_t state = 1;
  for (int i = 0; i < 100'000; ++i) {
    state = state * 6364136223846793005 + 1442695040888963407;
    const double value = std::bit_cast<double>(state);
    if (!std::isfinite(value)) continue;
    const double read = std::strtod(shortest_text(value).c_str(), nullptr);
    EXPECT_EQ(std::bit_cast<std::uint64_t>(read), state);
  }
}

TEST(CsvRows, AreNeverEmptyLines) {
  EXPECT_EQ(written(RowFormat::csv, {"a"}, {{null}, {0.5}}), "a\r\n\"\"\r\n0.5\r\n");
}

TEST(JsonRows, CanBeReadWhateverTheyHold) {
  const std::string json =
      written(RowFormat::json, {"quote \" \n"},
              {{text("\x1b \" \\ \xff \n")}, {Blob{"\x01"}}, {1e300}, {std::int64_t{1} << 62}});
  const auto read = nlohmann::json::parse(json);
  const std::string key = "quote \" \n";
  EXPECT_EQ(read.at(0).at(key), "\x1b \" \\ \ufffd \n");
  EXPECT_EQ(read.at(1).at(key), "x'01'");
  EXPECT_EQ(read.at(2).at(key), 1e300);
  EXPECT_EQ(read.at(3).at(key), std::int64_t{1} << 62);
}

TEST(TableRows, CutTextToFitTheTerminalAndNeverANumber) {
  const std::vector<CellRow> rows{{text("a long text that goes on and on"), integer(123456789)}};
  EXPECT_EQ(
      written(RowFormat::table, {"text", "value"}, rows, {.num_rows_max = 10, .num_columns = 25}),
      "text                value\n"
      "──────────────  ─────────\n"
      "a long text t…  123456789\n");
}

// A table of these two columns takes at least 8 + 2 + 9 of the 16 columns of the terminal. In a
// record text is cut and a number is not.
TEST(TableRows, ThatAreWiderThanTheTerminalAreRecords) {
  const std::vector<CellRow> rows{{text("a long text"), integer(123456789)}, {null, integer(2)}};
  EXPECT_EQ(
      written(RowFormat::table, {"text", "value"}, rows, {.num_rows_max = 10, .num_columns = 16}),
      "row 1\n"
      "  text   a long…\n"
      "  value  123456789\n"
      "row 2\n"
      "  text\n"
      "  value  2\n");
}

TEST(TableRows, CutVeryLongText) {
  const std::string table = written(RowFormat::table, {"a"}, {{text(std::string(1'000'000, 'x'))}});
  EXPECT_NE(table.find("\n" + std::string(99, 'x') + "…\n"), std::string::npos);
  EXPECT_LT(table.size(), 600u);
}

}  // namespace
}  // namespace proofmass::coordinator
