// Assertions are for our own mistakes. A table says of each why neither a peer's bytes nor a file's
// can reach it.

#include "tests/tidy/assertions.hpp"

#include "tests/test.hpp"

namespace proofmass::test {
namespace {

std::vector<SourceFile> one_file(const std::string& text) {
  return {{.path = "core/a.cpp", .text = text}};
}

TEST(Assertions, AreFoundOverSeveralLinesAndNotInComments) {
  const auto found = assertions_in(
      one_file("  PROOFMASS_EXPECT(f(a) &&\n      b == ')');  // PROOFMASS_EXPECT(c)\n"
               "  PROOFMASS_KERNEL_EXPECT(d);\n#define PROOFMASS_EXPECT(e) g(e)\n")[0]);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].condition, "f(a) && b == ')'");
}

TEST(Assertions, MustStandInTheTable) {
  const auto files = one_file("PROOFMASS_EXPECT(a);\nPROOFMASS_EXPECT(b);\n");
  const std::string a = "core/a.cpp | a | It is checked where it enters.\n";
  const Findings findings = check_assertions(files, "# Comment.\n" + a);
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0], "core/a.cpp: PROOFMASS_EXPECT(b) is not in tests/tidy/assertions.txt");
  EXPECT_TRUE(check_assertions(files, "core/a.cpp | * | All are checked elsewhere.\n").empty());
}

TEST(Assertions, AreCounted) {
  const auto files = one_file("PROOFMASS_EXPECT(a);\nPROOFMASS_EXPECT(a);\n");
  EXPECT_EQ(check_assertions(files, "core/a.cpp | a | It is checked where it enters.\n").size(),
            2U);
  EXPECT_TRUE(
      check_assertions(files, "core/a.cpp | 2 x a | It is checked where it enters.\n").empty());
}

TEST(Assertions, ThatAreGoneLeaveTheTable) {
  const std::string line = "core/a.cpp | a | It is checked where it enters.";
  const Findings findings = check_assertions(one_file(""), line + "\n");
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0], "assertions.txt: there is no such assertion: " + line);
}

TEST(Assertions, HaveAReason) {
  const auto files = one_file("PROOFMASS_EXPECT(a);\n");
  EXPECT_EQ(check_assertions(files, "core/a.cpp | a | Sure.\n").size(), 1U);
  EXPECT_EQ(check_assertions(files, "core/a.cpp | a\n").size(), 2U);
}

TEST(Repository, SaysOfEachAssertionWhyNobodyElseReachesIt) {
  std::ifstream stream(PROOFMASS_SOURCE_DIR "/tests/tidy/assertions.txt");
  const std::string table{std::istreambuf_iterator<char>(stream), {}};
  for (const std::string& finding : check_assertions(read_sources(PROOFMASS_SOURCE_DIR), table)) {
    ADD_FAILURE() << finding;
  }
}

}  // namespace
}  // namespace proofmass::test
