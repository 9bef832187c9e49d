#include "coordinator/query/aggregates.hpp"

#include <initializer_list>

#include "core/error.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using Row = std::vector<std::optional<double>>;

const Aggregate& aggregate(std::string_view name) {
  return *std::ranges::find(aggregates(), name,
                            [](const Aggregate& a) { return std::string_view(a.name); });
}

std::optional<double> value_of(std::string_view name, const std::vector<Row>& rows) {
  AggregateRows group(aggregate(name));
  for (const Row& row : rows) group.add(row);
  return group.value();
}

std::vector<Row> rows_of(std::initializer_list<double> values) {
  std::vector<Row> rows;
  for (const double value : values) rows.push_back({value});
  return rows;
}

std::vector<Row> with(std::vector<Row> rows, std::initializer_list<double> parameters) {
  for (Row& row : rows) row.insert(row.end(), parameters.begin(), parameters.end());
  return rows;
}

std::string error_of(std::string_view name, const std::vector<Row>& rows) {
  try {
    (void)value_of(name, rows);
  } catch (const InvalidArgument& error) {
    return error.what();
  }
  return {};
}

const std::vector<Row> eight = rows_of({2, 4, 4, 4, 5, 5, 7, 9});

// Their numbers are confirmed by aggregates_oracle.py.
TEST(Aggregates, AreNullOfTooFewRowsOrRowsThatDoNotVary) {
  struct Case {
    std::string_view name;
    std::vector<Row> rows;
    std::optional<double> expected = std::nullopt;
  };
  for (const Case& of :
       std::vector<Case>{{"stdev", rows_of({3.0, 3.0}), 0.0},
                         {"stdev", rows_of({3.0})},
                         {"skewness", rows_of({1.0, 2.0})},
                         {"skewness", rows_of({1.0, 1.0, 1.0})},
                         {"median", rows_of({7}), 7.0},
                         {"kurtosis", rows_of({1, 2, 4})},
                         {"kurtosis", rows_of({0.1, 0.1, 0.1, 0.1, 0.1})},
                         {"regr_slope", {{5.0, 1.0}}},
                         {"regr_slope", {{5.0, 0.1}, {6.0, 0.1}, {7.0, 0.1}}},  // x does not vary.
                         {"regr_slope", {{5.0, 1.0}, {5.0, 2.0}}, 0.0},
                         {"correlation", {{1.0, 1.0}, {2.0, 2.0}, {3.0, 3.0}}},
                         {"correlation", {{1.0, 1.0}, {2.0, 1.0}, {3.0, 1.0}, {4.0, 1.0}}}}) {
    EXPECT_EQ(value_of(of.name, of.rows), of.expected) << of.name;
  }
}

// Multiples of 2⁻²⁰ around 1e8 are doubles, so that only the statistics could round. y = x/3 + 2 in
// whole numbers with x near 1e8: the rounding of the slope alone would put the line at x = 0 off by
// 1.9e-9.
TEST(Aggregates, KeepTheirDigitsBesideALargeOffset) {
  std::vector<Row> rows, line;
  for (int i = -500; i <= 500; ++i) {
    rows.push_back({1e8 + std::ldexp(i, -20)});
    const double third = 33333333.0 + i;
    line.push_back({third + 2.0, 3.0 * third});
  }
  const double exact = std::ldexp(std::sqrt(1001.0 * 1002.0 / 12.0), -20);
  EXPECT_NEAR(*value_of("stdev", rows) / exact, 1.0, 1e-15);
  EXPECT_NEAR(*value_of("kurtosis", rows), -1.2, 1e-13);
  EXPECT_EQ(value_of("regr_slope", line), 1.0 / 3.0);
  EXPECT_NEAR(*value_of("regr_intercept", line), 2.0, 1e-12);
}

// A power of two changes no digit, whatever squares and fourth powers would be.
TEST(Aggregates, KeepTheirDigitsAtTheEndsOfTheRangeOfADouble) {
  const std::vector<Row> plain{{1.0, 1.0}, {2.0, 3.0}, {3.5, 2.0}, {4.0, 4.0}, {7.0, 4.5}};
  for (const int exponent : {1020, 400, -400, -1000}) {
    std::vector<Row> rows = plain;
    for (Row& row : rows) row = {std::ldexp(*row[0], exponent), std::ldexp(*row[1], -exponent)};
    std::vector<Row> plain_x = plain, x = rows;
    for (Row& row : plain_x) row.resize(1);
    for (Row& row : x) row.resize(1);
    EXPECT_EQ(value_of("stdev", x), std::ldexp(*value_of("stdev", plain_x), exponent));
    for (const char* name : {"skewness", "kurtosis"}) {
      EXPECT_EQ(value_of(name, x), value_of(name, plain_x)) << name;
    }
    for (const char* name : {"correlation", "rank_correlation"}) {
      EXPECT_EQ(value_of(name, rows), value_of(name, plain)) << name;
    }
    EXPECT_EQ(value_of("regr_intercept", rows),
              std::ldexp(*value_of("regr_intercept", plain), exponent));
  }
  constexpr double large = 1e308;
  EXPECT_EQ(value_of("median", rows_of({-large, large})), 0.0);
  EXPECT_EQ(value_of("percentile", with(rows_of({-large, large}), {75.0})), 0.5 * large);
  EXPECT_EQ(value_of("median", rows_of({5e-324, 5e-324, 1e308})), 5e-324);
}

TEST(Aggregates, RefuseAResultThatIsNoDouble) {
  EXPECT_EQ(error_of("stdev", rows_of({-1.7e308, 1.7e308})),
            "x is too large (the result is no finite double)");
  EXPECT_EQ(error_of("regr_slope", {{-1e308, 0.0}, {1e308, 1e-300}}),
            "y is too large (the result is no finite double)");
}

// Each value after some rows left is that of a group of the rows that stayed, to the last bit.
TEST(Aggregates, OfAFrameHaveTheBitsOfAGroup) {
  std::mt19937_64 engine(12);
  const auto random = [&] { return 1e8 + std::ldexp(static_cast<double>(engine() >> 50U), -10); };
  for (const Aggregate& function : aggregates()) {
    std::vector<Row> rows;
    for (int i = 0; i < 300; ++i) {
      Row row{random()};
      if (function.num_columns == 2) row.push_back(random());
      if (i % 7 == 3) row[0] = std::nullopt;
      row.resize(function.arguments.size(), 60.0);
      rows.push_back(row);
    }
    AggregateRows frame(function);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      frame.add(rows[i]);
      if (i >= 50) frame.remove(rows[i - 50]);
      if (i % 3 == 0) continue;  // Two rows may come between values.
      AggregateRows group(function);
      for (std::size_t k = i < 50 ? 0 : i - 49; k <= i; ++k) group.add(rows[k]);
      ASSERT_EQ(frame.value(), group.value()) << function.name << " " << i;
    }
  }
}

TEST(Aggregates, AreEmptyAgainWhenAllRowsLeft) {
  for (const Aggregate& function : aggregates()) {
    AggregateRows frame(function);
    for (const double value : {1.0, 2.0, 4.0, 8.0, 9.0}) {
      Row row(function.num_columns, value);
      row.resize(function.arguments.size(), 50.0);
      frame.add(row);
      frame.remove(row);
    }
    EXPECT_FALSE(frame.value()) << function.name;
  }
}

TEST(Aggregates, WilksUpperCountsANullAsLargerThanAnyValue) {
  std::vector<Row> rows;
  for (int i = 1; i <= 92; ++i) rows.push_back({double(i), 95.0, 95.0});
  rows.push_back({std::nullopt, 95.0, 95.0});
  EXPECT_EQ(value_of("wilks_upper", rows), 92.0);
  rows.push_back({std::nullopt, 95.0, 95.0});
  EXPECT_FALSE(value_of("wilks_upper", rows));
}

TEST(Aggregates, AreEmptyWithoutAnyValue) {
  for (const Aggregate& function : aggregates()) {
    EXPECT_FALSE(AggregateRows(function).value()) << function.name;
    Row row(function.num_columns);
    row.resize(function.arguments.size(), 50.0);
    EXPECT_FALSE(value_of(function.name, {row})) << function.name;  // Of a NULL.
  }
}

// The bits, as the sums in another order differ in the last ones.
TEST(Aggregates, DoNotDependOnTheOrderOfRows) {
  std::mt19937_64 engine(11);
  std::vector<Row> rows;
  for (int i = 0; i < 2000; ++i) {
    const double x = 1e8 + std::ldexp(static_cast<double>(engine() >> 11U), -53);
    rows.push_back({x, std::ldexp(static_cast<double>(engine() >> 44U), -30)});
  }
  rows.push_back({0.0, -0.0});
  rows.push_back({-0.0, 0.0});
  for (const Aggregate& function : aggregates()) {
    const auto shuffled_bits = [&] {
      std::ranges::shuffle(rows, engine);
      AggregateRows group(function);
      for (Row row : rows) {
        row.resize(function.num_columns);
        row.resize(function.arguments.size(), 90.0);
        group.add(row);
      }
      return std::bit_cast<std::uint64_t>(*group.value());
    };
    const std::uint64_t first = shuffled_bits();
    for (int i = 0; i < 20; ++i) EXPECT_EQ(shuffled_bits(), first) << function.name;
  }
}

TEST(Aggregates, HaveNoNegativeZero) {
  EXPECT_FALSE(std::signbit(*value_of("percentile", with(rows_of({-0.0, -0.0}), {100.0}))));
}

TEST(Aggregates, RefuseParametersThatBreakTheirRule) {
  EXPECT_EQ(error_of("percentile", with(eight, {101.0})), "p = 101 (must be in [0, 100])");
  EXPECT_EQ(error_of("percentile", with(eight, {-0.5})), "p = -0.5 (must be in [0, 100])");
  EXPECT_EQ(error_of("percentile", {{1.0, std::nullopt}}), "p = NULL (must be a number)");
  EXPECT_EQ(error_of("percentile", {{1.0, 50.0}, {1.0, 60.0}}),
            "p = 60 (must be the same for all rows, was 50)");
  EXPECT_EQ(error_of("percentile", {{1.0, 50.0}, {std::nullopt, 60.0}}),
            "p = 60 (must be the same for all rows, was 50)");
  EXPECT_EQ(error_of("wilks_upper", with(eight, {0.95, 95.0})),
            "coverage = 0.95 (must be per cent in [1, 100), not a fraction)");
  EXPECT_EQ(error_of("wilks_upper", with(eight, {95.0, 100.0})),
            "confidence = 100 (must be per cent in [1, 100), not a fraction)");
}

TEST(Aggregates, RefuseInfinity) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(error_of("stdev", rows_of({1.0, infinity})), "x = inf (must be finite)");
  EXPECT_EQ(error_of("correlation", {{1.0, -infinity}}), "y = -inf (must be finite)");
}

TEST(Aggregates, RefuseMoreRowsThanTheyMayCollect) {
  AggregateRows group(aggregate("stdev"), 2);
  const Row row{1.0};
  group.add(row);
  group.add(row);
  group.add(Row{std::nullopt});  // Takes no room.
  try {
    group.add(row);
    FAIL();
  } catch (const InvalidArgument& error) {
    EXPECT_STREQ(error.what(), "x > 2 rows (too many to collect)");
  }
}

TEST(Aggregates, HaveNoValueAfterARowThatWasRefused) {
  AggregateRows group(aggregate("percentile"));
  const Row row{1.0, std::nullopt};
  EXPECT_THROW(group.add(row), InvalidArgument);
  EXPECT_FALSE(group.value());
}

}  // namespace
}  // namespace proofmass::coordinator
