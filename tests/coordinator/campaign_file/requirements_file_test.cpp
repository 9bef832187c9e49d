#include "coordinator/campaign_file/requirements_file.hpp"

#include <gmock/gmock.h>
#include <sys/stat.h>

#include <string>

#include "core/definition/document.hpp"
#include "tests/coordinator/campaign_file/scratch_folder.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::string_view good =
    "[[requirements]]\nid = \"SYS-1\"\ntext = \"Known well.\"\n"
    "requirement = \"a_c12 < 9e-4 for 99% with 95%\"\n"
    "[[requirements]]\nid = \"SYS-2\"\n"
    "requirement = \"all objectives for 95% with 90%\"\n";

/// What is said against a file with this text, from its name on; empty if nothing is.
std::string refusal_of_requirements(const std::string& text) {
  const test::ScratchFolder folder;
  try {
    (void)read_requirements(folder.write("r.toml", text));
    return "";
  } catch (const DefinitionError& error) {
    const std::string message = error.what();
    return message.substr(message.find("r.toml"));
  }
}

TEST(RequirementsFile, HasIdTextAndRequirement) {
  const test::ScratchFolder folder;
  const std::vector<StatedRequirement> read = read_requirements(folder.write("r.toml", good));
  ASSERT_EQ(read.size(), 2U);
  EXPECT_EQ(read[0].id, "SYS-1");
  EXPECT_EQ(read[0].text, "Known well.");
  EXPECT_EQ(read[0].requirement, "a_c12 < 9e-4 for 99% with 95%");
  EXPECT_EQ(read[1].text, "");
}

TEST(RequirementsFile, NamesWhatIsMissing) {
  EXPECT_THAT(refusal_of_requirements(""),
              testing::HasSubstr("requirements is missing (must be a list of tables"));
  EXPECT_THAT(refusal_of_requirements("[[requirements]]\nrequirement = \"k2c < 1 for 9% with 9%\""),
              testing::HasSubstr("requirements[0].id is missing (must be given)"));
  EXPECT_THAT(refusal_of_requirements("[[requirements]]\nid = \"a\"\n"),
              testing::HasSubstr("requirements[0].requirement is missing (must be given"));
}

TEST(RequirementsFile, NamesWhatIsWrong) {
  EXPECT_EQ(
      refusal_of_requirements(std::string(good) + "[[requirements]]\nid = \"SYS-1\"\n"
                                                  "requirement = \"k2c < 1 for 9% with 9%\"\n"),
      "r.toml:9: requirements[2].id = \"SYS-1\" (must be unique)");
  EXPECT_EQ(refusal_of_requirements("[[requirements]]\nid = \"\"\n"
                                    "requirement = \"k2c < 1 for 9% with 9%\"\n"),
            "r.toml:2: requirements[0].id = \"\" (must not be empty)");
  EXPECT_THAT(refusal_of_requirements("[[requirements]]\nid = \"a\"\n"
                                      "requirement = \"k2e < 1 for 9% with 9%\"\n"),
              testing::StartsWith("r.toml: requirements[0].requirement = k2e < 1 for 9% with 9% ("
                                  "k2e is no parameter"));
  EXPECT_THAT(refusal_of_requirements(std::string(good) + "[[requirement]]\n"),
              testing::HasSubstr("requirement = [...] (unknown key)"));
}

TEST(RequirementsFile, LimitsWhatIsRead) {
  const auto with = [](const std::string& key, std::size_t size) {
    return "[[requirements]]\nid = \"a\"\nrequirement = \"k2c < 1 for 9% with 9%\"\n" + key +
           " = \"" + std::string(size, 'x') + "\"\n";
  };
  EXPECT_EQ(refusal_of_requirements(with("text", 1000)), "");
  EXPECT_THAT(refusal_of_requirements(with("text", 1001)),
              testing::HasSubstr("(must have at most 1000 bytes)"));
  std::string many;
  for (int i = 0; i < 101; ++i) {
    many += "[[requirements]]\nid = \"" + std::to_string(i) +
            "\"\nrequirement = \"k2c < 1 for 9% with 9%\"\n";
  }
  EXPECT_THAT(refusal_of_requirements(many), testing::HasSubstr("requirements"));
  EXPECT_THAT(refusal_of_requirements(std::string(300'000, '#')), testing::HasSubstr("r.toml: "));
}

TEST(RequirementsFile, IsNoPipe) {
  const test::ScratchFolder folder;
  const std::filesystem::path pipe = folder.path() / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);  // Nobody writes to it.
  EXPECT_THROW((void)read_requirements(pipe), DefinitionError);
}

}  // namespace
}  // namespace proofmass::coordinator
