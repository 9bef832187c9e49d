#include "core/definition/definition_text.hpp"

#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/test.hpp"

namespace proofmass::detail {
namespace {

TEST(EditDistance, CountsInsertionsDeletionsReplacementsAndSwaps) {
  EXPECT_EQ(edit_distance("kitten", "sitting"), 3u);
  EXPECT_EQ(edit_distance("", "abc"), 3u);
  EXPECT_EQ(edit_distance("abc", ""), 3u);
  EXPECT_EQ(edit_distance("scael", "scale"), 1u);
  EXPECT_EQ(edit_distance("ca", "abc"), 3u);  // A swapped pair is not split again.
  EXPECT_EQ(edit_distance("scale", "scale"), 0u);
}

TEST(NearestName, IsTheCandidateWithTheFewestEditsIfOneIsNear) {
  EXPECT_EQ(nearest_name("noise.scal", {"noise.preset", "noise.scale", "orbit.period_s"}),
            "noise.scale");
  EXPECT_EQ(nearest_name("weather", {"noise.preset", "noise.scale"}), std::nullopt);
  EXPECT_EQ(nearest_name("weather", {}), std::nullopt);
}

std::string repeated(const std::string& text, int count) {
  std::string result;
  for (int i = 0; i < count; ++i) result += text;
  return result;
}

TEST(Nesting, OfADefinitionIsShallow) {
  EXPECT_FALSE(line_of_deep_nesting(canonical_definition(hardy2013_campaign())));
  EXPECT_FALSE(line_of_deep_nesting(commented_campaign(hardy2013_campaign())));
}

TEST(Nesting, IsCountedInKeys) {
  const std::string key = repeated("a.", nesting_max - 1) + "a";
  EXPECT_FALSE(line_of_deep_nesting(key + " = 1\n[" + key + "]\n" + key + " = 1.5"));
  EXPECT_EQ(line_of_deep_nesting("x = 1\na." + key + " = 1"), 2U);
  EXPECT_EQ(line_of_deep_nesting(std::string("[a.") + key + "]"), 1U);
  EXPECT_EQ(line_of_deep_nesting("x = {a . " + key + " = 1}"), 1U);
  EXPECT_EQ(line_of_deep_nesting(repeated("\"=\". '#' .", nesting_max) + "a = 1"), 1U)
      << "what is quoted is a part as well";
}

TEST(Nesting, IsCountedInListsAndTables) {
  EXPECT_FALSE(line_of_deep_nesting(std::string("a = ") + repeated("[", nesting_max) +
                                    repeated("]", nesting_max) + "\nb = [1]"));
  EXPECT_EQ(line_of_deep_nesting(std::string("a = [\n") + repeated("[", nesting_max)), 2U);
  EXPECT_EQ(line_of_deep_nesting(std::string("a = ") + repeated("{a = ", nesting_max + 1)), 1U);
}

// What stands in texts and comments is no key, wherever they end, and what stands behind is one.
TEST(Nesting, IsNotCountedInTextsAndComments) {
  const std::string dots(100, '.');
  const std::string deep = std::string("\n") + repeated("x.", nesting_max) + "x";
  const std::vector<std::string> texts{"\"" + dots + "\"",
                                       "'" + dots + "'",
                                       "\"\\\"" + dots + "\"",
                                       "\"\\\\\"",
                                       "'\\'",
                                       "\"\"",
                                       "''",
                                       "\"\"\"" + dots + "\n\"\"" + dots + "\"\"\"",
                                       "'''" + dots + "\n'" + dots + "'''",
                                       "\"\"\"\"\"\"",
                                       "\"\"\"\"" + dots + "\"\"\"\"\"",
                                       "\"\"\"\\\"\"\" \"\"\"",
                                       "1 # " + dots,
                                       "1 # '''",
                                       "1 # \"\"\"",
                                       "1 # ' " + dots};
  for (const std::string& text : texts) {
    EXPECT_FALSE(line_of_deep_nesting(std::string("a = ") + text + "\nb = 1\n")) << text;
    EXPECT_TRUE(line_of_deep_nesting(std::string("a = ") + text + deep + " = 1")) << text;
  }
}

TEST(Nesting, IsCountedBehindATextThatEndsWithQuotes) {
  const std::string deep = repeated("x.", nesting_max) + "x";
  for (const char* const quotes : {"\"\"\"", "\"\"\"\"", "\"\"\"\"\""}) {
    EXPECT_TRUE(line_of_deep_nesting(std::string("a = {b = \"\"\"c") + quotes + ", " + deep))
        << quotes;
  }
}

TEST(Nesting, EndsWithTheText) {
  for (const char* const text :
       {"", "a = \"", "a = \"\\", "a = '''", "a = \"\"\"\\", "#", "[", "]"}) {
    EXPECT_FALSE(line_of_deep_nesting(text)) << text;
  }
}

}  // namespace
}  // namespace proofmass::detail
