// Files that hold anything: campaign databases by all that reads them, and the texts that people
// write.

#include <regex>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/net/authentication/rights.hpp"
#include "core/definition/csv.hpp"
#include "core/error.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "core/microscope/simulation/run.hpp"
#include "proto/link/keys.hpp"
#include "tests/fuzz/file_mutator.hpp"
#include "tests/fuzz/file_world.hpp"
#include "tests/proto/link/scratch_directory.hpp"
#include "tests/support/microscope_results.hpp"
#include "tests/support/parse_campaign.hpp"
#include "tests/test.hpp"

namespace proofmass::test {
namespace {

/// PROOFMASS_FILES in the environment for another number.
std::uint64_t num_files() {
  const char* const number = std::getenv("PROOFMASS_FILES");
  return number == nullptr ? 20 * num_file_uses : std::stoull(number);
}

constexpr std::uint64_t num_texts = 1000;

TEST(MutatedCampaignFiles, AreReadOrRefused) {
  const ScratchDirectory directory;
  std::filesystem::create_directories(directory / "seeds");
  std::filesystem::create_directories(directory / "used");
  const auto originals = make_seed_files(directory / "seeds");
  for (std::uint64_t seed = 1; seed <= num_files(); ++seed) {
    FileMutator mutator(seed);
    mutator.make(originals, directory / "used/x.db");
    const auto use = static_cast<FileUse>(seed % num_file_uses);
    EXPECT_EQ(use_file(use, directory / "used/x.db", originals[0]), "") << "file " << seed;
  }
}

// Without this a mutation that nothing reads would pass.
TEST(MutatedCampaignFiles, BeginFromFilesThatEveryUseTakes) {
  const ScratchDirectory directory;
  std::filesystem::create_directories(directory / "seeds");
  std::filesystem::create_directories(directory / "used");
  const auto used = directory / "used/x.db";
  for (const auto& original : make_seed_files(directory / "seeds")) {
    for (std::size_t use = 0; use < num_file_uses; ++use) {
      std::filesystem::copy_file(original, used, std::filesystem::copy_options::overwrite_existing);
      EXPECT_EQ(take_file(static_cast<FileUse>(use), used, original), "") << use << original;
    }
  }
}

class MutatedTexts : public testing::Test {
 protected:
  /// Hands `num_texts` changed texts to a reader, which may refuse them with an Error.
  static void mutate(const std::string& text, const std::function<void(const std::string&)>& read) {
    FileMutator mutator(7);
    std::uint64_t num_read = 0;
    for (std::uint64_t i = 0; i < num_texts; ++i) {
      const std::string changed = mutator.changed_text(text);
      try {
        read(changed);
        ++num_read;
      } catch (const Error&) {
      }
    }
    EXPECT_GT(num_read, num_texts / 200);
    EXPECT_LT(num_read, num_texts);
  }

  ScratchDirectory directory_;
};

TEST_F(MutatedTexts, AreDefinitionsOrRefused) {
  const auto file = directory_ / "campaign.toml";
  mutate(canonical_definition(hardy2013_campaign()), [&](const std::string& text) {
    std::ofstream(file, std::ios::binary) << text;
    coordinator::read_campaign(file)->validate();
  });
}

/// What a campaign of one orbit a session and one sample a second is stored as.
std::string short_definition() {
  MicroscopeCampaign campaign = hardy2013_campaign();
  campaign.scenario.simulation.sample_period_s = 1.0;
  campaign.scenario.simulation.settling_s = 0.0;
  for (Session& session : campaign.scenario.sessions) session.num_orbits = 1;
  return canonical_definition(campaign);
}

// A worker that gets a definition which was accepted must be able to compute its runs: it may
// diverge, but not end by an assertion.
TEST_F(MutatedTexts, WithExtremeNumbersAreDefinitionsThatCanBeSimulatedOrRefused) {
  const std::string text = short_definition();
  const std::regex number("\n[a-z_0-9]+ = (-?[0-9.][-+0-9.e]*)(?=\n)");
  std::size_t num_simulated = 0;
  std::size_t num_refused = 0;
  std::set<std::string> seen;  // The sessions say the same ten times.
  for (auto match = std::sregex_iterator(text.begin(), text.end(), number);
       match != std::sregex_iterator(); ++match) {
    if (!seen.insert(match->str()).second) continue;
    for (const char* const value : {"0", "1e-300", "1e9", "1e300"}) {
      const std::string changed =
          std::string(text).replace(static_cast<std::size_t>(match->position(1)),
                                    static_cast<std::size_t>(match->length(1)), value);
      SCOPED_TRACE(match->str() + " becomes " + value);
      try {
        const MicroscopeCampaign campaign = test::parse_campaign("stored definition", changed);
        const RunPlan plan(campaign);
        (void)plan.simulate_batch(std::array{RunRequest{}}, best_instruction_set());
        ++num_simulated;
      } catch (const Error&) {
        ++num_refused;
      }
    }
  }
  EXPECT_GT(num_simulated, 100U);
  EXPECT_GT(num_refused, 100U);
}

TEST_F(MutatedTexts, AreListsOfKeysOrRefused) {
  std::string text = "# Workers.\n\n";
  for (const char* const name : {"one", "two", "three"}) {
    text += wire::make_key_pair().public_key.text() + " " + name + "\n";
  }
  mutate(text, [](const std::string& changed) {
    (void)coordinator::parse_allow_list(changed, wire::KeyRole::worker, "authorized_workers");
    (void)coordinator::parse_allow_list(changed, wire::KeyRole::client, "authorized_clients");
  });
}

TEST_F(MutatedTexts, AreEnvironmentTablesOrRefused) {
  std::string text =
      "time_s,linear_x_m_s2,linear_y_m_s2,linear_z_m_s2,angular_x_rad_s2,angular_y_rad_s2,"
      "angular_z_rad_s2\n";
  for (int i = 0; i < 8; ++i) text += std::to_string(1000 * i) + ",1e-8,2e-8,0,1e-9,0,-1.5e-9\n";
  mutate(text, [](const std::string& changed) {
    (void)parse_environment(changed, "environment.csv", 5950.0);
  });
}

TEST_F(MutatedTexts, AreColumnsOrRefused) {
  mutate("a,b\n1.5,2\n-3e-4,0\n7,8\n",
         [](const std::string& changed) { (void)parse_column(changed, "draws.csv", "b"); });
}

}  // namespace
}  // namespace proofmass::test
