#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <string>
#include <vector>

#include "tests/coordinator/cli/temporary_directory.hpp"
#include "tests/system/process.hpp"
#include "tests/system/stored_runs.hpp"

namespace proofmass::test {

using Arguments = std::vector<std::string>;

inline const std::string programs = PROOFMASS_PROGRAMS;
inline constexpr std::size_t num_runs =
    320;  // 20 batches, so that there is an end to be killed before.

inline bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

/// A directory with a campaign whose batches take a tenth of a second: the paper's, with
/// sessions of two orbits.
class CampaignProcess : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(
        Process(directory / "", "init", programs + "/proofmass", {"init", "paper.toml"}).wait(), 0);
    std::string text = read_file(directory / "paper.toml");
    text = std::regex_replace(text, std::regex("\norbits = [0-9]+"), "\norbits = 2");
    text = std::regex_replace(text, std::regex("\nruns = [0-9]+"),
                              "\nruns = " + std::to_string(num_runs));
    text = std::regex_replace(text, std::regex("\nsample_period_s = [0-9.]+"),
                              "\nsample_period_s = 1");
    std::ofstream(directory / "short.toml") << text;
  }

  [[nodiscard]] std::filesystem::path path(const std::string& name) const {
    return directory / name;
  }

  /// `proofmass run short.toml --db NAME.db` with further arguments; output in NAME.out, NAME.err.
  [[nodiscard]] Process start(const std::string& name, const Arguments& further) const {
    Arguments arguments{"run", "short.toml", "--db", name + ".db"};
    arguments.insert(arguments.end(), further.begin(), further.end());
    return Process(directory / "", name, programs + "/proofmass", arguments);
  }

  [[nodiscard]] std::string errors_of(const std::string& name) const {
    return read_file(path(name + ".err"));
  }

  /// The whole campaign, by one worker, undisturbed.
  [[nodiscard]] std::map<std::int64_t, StoredRun> reference() const {
    EXPECT_EQ(start("reference", {"--workers", "1"}).wait(), 0) << errors_of("reference");
    auto runs = stored_runs(path("reference.db"));
    EXPECT_EQ(runs.size(), num_runs);
    return runs;
  }

  /// Waits until so many runs are stored while the campaign goes on.
  void wait_for_runs(const std::string& name, std::size_t count) const {
    wait_until("stored runs", [&] { return num_stored(path(name + ".db")) >= count; });
  }

  TemporaryDirectory directory;
};

}  // namespace proofmass::test
