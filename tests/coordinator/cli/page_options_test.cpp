#include "coordinator/cli/page_options.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "coordinator/cli/program.hpp"
#include "tests/coordinator/cli/temporary_directory.hpp"
#include "tests/message_of.hpp"

namespace proofmass::coordinator {
namespace {

/// What a program with a file as its argument makes of these words.
struct ParsedPage {
  std::optional<PageConfig> config;
  std::string file;
};

ParsedPage parsed_page(const std::string& words) {
  CLI::App app("", "program");
  PageOptions options;
  ParsedPage parsed;
  app.add_option("FILE", parsed.file);
  add_page_options(app, options);
  app.parse(words);
  parsed.config = page_config_of(options);
  return parsed;
}

TEST(PageOption, IsOffUnlessGiven) { EXPECT_FALSE(parsed_page("a.toml").config.has_value()); }

TEST(PageOption, TakesNoFileForAnAddress) {
  const ParsedPage parsed = parsed_page("--page a.toml");
  EXPECT_EQ(parsed.file, "a.toml");
  ASSERT_TRUE(parsed.config.has_value());
  EXPECT_EQ(url_of(parsed.config->address), "http://127.0.0.1:5557/");
}

TEST(PageOption, TakesAnAddressBehindItsName) {
  const test::TemporaryDirectory directory;
  const std::string token = (directory / "token").string();
  std::ofstream(token) << "0123456789abcdef\n";
  std::filesystem::permissions(token, std::filesystem::perms::owner_read);
  const ParsedPage parsed = parsed_page("--page=*:80 --page-token-file " + token + " a.toml");
  ASSERT_TRUE(parsed.config.has_value());
  EXPECT_EQ(parsed.config->address.port, 80);
  EXPECT_FALSE(parsed.config->address.is_loopback);
  EXPECT_EQ(parsed.config->token_file, token);
}

// `run` asks for this before it makes a database.
TEST(PageOption, NeedsATokenBeyondThisMachine) {
  EXPECT_EQ(test::message_of<InvalidArgument>([] { (void)parsed_page("--page=1.2.3.4:80"); }),
            "page = 1.2.3.4:80 (must be a loopback address, or with --page-token-file)");
  EXPECT_EQ(test::message_of<Error>(
                [] { (void)parsed_page("--page=1.2.3.4:80 --page-token-file missing"); }),
            "page token file = missing (No such file or directory)");
}

TEST(PageOption, MustBeAnAddress) {
  EXPECT_EQ(
      test::message_of<InvalidArgument>([] { (void)parsed_page("--page=a.toml"); }).substr(0, 31),
      "page = a.toml (must be HOST:POR");
}

TEST(PageOption, IsNeededForAToken) {
  EXPECT_EQ(test::message_of<UsageError>([] { (void)parsed_page("--page-token-file t"); }),
            "page token file = t (must be with --page)");
}

}  // namespace
}  // namespace proofmass::coordinator
