#include "tests/test.hpp"
#include "tests/tidy/rules.hpp"

namespace proofmass::test {
namespace {

const std::vector<SourceFile>& sources() {
  static const std::vector<SourceFile> files = read_sources(PROOFMASS_SOURCE_DIR);
  return files;
}

// Fails once for each violation in any file.
void expect_none(Findings (*rule)(const SourceFile&)) {
  for (const SourceFile& file : sources()) {
    for (const std::string& finding : rule(file)) ADD_FAILURE() << finding;
  }
}

TEST(Repository, HasSources) { EXPECT_GT(sources().size(), 50u); }
TEST(Repository, KeepsItsLayers) { expect_none(check_layers); }
TEST(Repository, LinksProgramsAloneWithAModel) { expect_none(check_links); }
TEST(Repository, GuardsItsHeaders) { expect_none(check_header_guard); }
TEST(Repository, KeepsFilesAndLinesShort) { expect_none(check_size); }
TEST(Repository, KeepsFunctionsShort) { expect_none(check_function_length); }
TEST(Repository, NamesTheIssueOfOpenWork) { expect_none(check_open_work); }
TEST(Repository, ComputesWithItsOwnElementaryFunctions) { expect_none(check_elementary_functions); }
TEST(Repository, UsesItsOwnWords) { expect_none(check_words); }
TEST(Repository, BuildsEverySource) {
  for (const std::string& finding : check_all_built(sources())) ADD_FAILURE() << finding;
}
TEST(Repository, DefinesEachTypeOnce) {
  for (const std::string& finding : check_types_unique(sources())) ADD_FAILURE() << finding;
}

}  // namespace
}  // namespace proofmass::test
