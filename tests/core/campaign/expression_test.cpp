#include "core/campaign/expression.hpp"

#include "core/error.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

double value_of(std::string_view text) {
  return evaluate_expression(text, [](std::string_view name) {
    if (name == "a.x") return 3.0;
    if (name == "b_2") return -0.5;
    throw InvalidArgument("unknown " + std::string(name));
  });
}

std::string refusal_of(std::string_view text) {
  return test::message_of<InvalidArgument>([&] { (void)value_of(text); });
}

TEST(EvaluateExpression, HasThePrecedenceOfArithmetic) {
  EXPECT_EQ(value_of("1 + 2 * a.x"), 7.0);
  EXPECT_EQ(value_of("(1 + 2) * a.x"), 9.0);
  EXPECT_EQ(value_of("8 / 4 / 2 - 1 - 1"), -1.0);
  EXPECT_EQ(value_of("-a.x * -b_2"), -1.5);
  EXPECT_EQ(value_of("--2"), 2.0);
  EXPECT_EQ(value_of("2 - -1e-3"), 2.001);
  EXPECT_EQ(value_of(".5*b_2"), -0.25);
}

TEST(EvaluateExpression, HasRootsAndWholePowers) {
  EXPECT_EQ(value_of("sqrt(a.x * 12)"), 6.0);
  EXPECT_EQ(value_of("pow(a.x, 4)"), 81.0);
  EXPECT_EQ(value_of("pow( b_2 , -3 )"), -8.0);
  EXPECT_EQ(value_of("pow(a.x, 0)"), 1.0);
  EXPECT_TRUE(std::isnan(value_of("sqrt(b_2)")));
  EXPECT_TRUE(std::isinf(value_of("1 / 0")));
}

TEST(EvaluateExpression, SaysWhereATextIsNoExpression) {
  const std::string operand = " must be a number, a quantity, sqrt, pow, - or (";
  EXPECT_EQ(refusal_of(""), "character 1" + operand);
  EXPECT_EQ(refusal_of("1 + "), "character 5" + operand);
  EXPECT_EQ(refusal_of("2 * / 3"), "character 5" + operand);
  EXPECT_EQ(refusal_of("(1 + 2"), "character 7 must be )");
  EXPECT_EQ(refusal_of("1 2"), "character 3 must be an operator or the end");
  EXPECT_EQ(refusal_of("a.x; rm"), "character 4 must be an operator or the end");
  EXPECT_EQ(refusal_of("pow(2, 17)"), "character 8 must be a whole number from -16 to 16");
  EXPECT_EQ(refusal_of("pow(2, -2147483648)"), "character 8 must be a whole number from -16 to 16");
  EXPECT_EQ(refusal_of("pow(2, 0.5)"), "character 9 must be )");
  EXPECT_EQ(refusal_of("pow(2)"), "character 6 must be ,");
  EXPECT_EQ(refusal_of("1e999"), "character 1 must be a number that a double can hold");
  EXPECT_EQ(refusal_of("sin(1)"), "unknown sin");
}

TEST(EvaluateExpression, LimitsItsDepth) {
  std::string nested(31, '(');
  nested.push_back('1');
  nested.append(31, ')');
  EXPECT_EQ(value_of(nested), 1.0);
  EXPECT_EQ(refusal_of(std::string(100'000, '(')), "character 33 is nested deeper than 32 levels");
  EXPECT_EQ(refusal_of(std::string(100'000, '-')), "character 33 is nested deeper than 32 levels");
}

}  // namespace
}  // namespace proofmass
