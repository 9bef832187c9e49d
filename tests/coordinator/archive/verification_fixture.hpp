#pragma once

#include "coordinator/archive/verification.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "tests/coordinator/archive/archive_fixture.hpp"

namespace proofmass::test {

/// A campaign of two batches with its results, and what verification says of its file.
class VerificationTest : public StoreTest {
 protected:
  using Check = coordinator::Check;
  using CheckOutcome = coordinator::CheckOutcome;

  VerificationTest() : campaign_(quick_campaign(18)) {
    static const std::vector<RunResult> results = simulated(campaign_);
    results_ = results;
  }

  /// A finished campaign, and nobody who has it open.
  void make_file() {
    coordinator::Store store = store_of(file(), campaign_, results_);
    coordinator::update_statistics(store, campaign_);
  }

  /// Verifies the file. @return Names of the checks that fail, in alphabetical order.
  std::vector<std::string> failing(const coordinator::VerifyOptions& options = {.fraction = 1.0,
                                                                                .num_threads = 2}) {
    checks_.clear();
    coordinator::verify(
        file(), options, [&](const Check& check) { checks_.emplace(check.name, check); },
        never_stopped);
    return names(CheckOutcome::fails);
  }

  [[nodiscard]] const Check& check(const std::string& name) const { return checks_.at(name); }

  /// Names of the checks with a verdict, in alphabetical order.
  [[nodiscard]] std::vector<std::string> names(CheckOutcome verdict) const {
    std::vector<std::string> found;
    for (const auto& [name, check] : checks_) {
      if (check.verdict == verdict) found.push_back(name);
    }
    return found;
  }

  MicroscopeCampaign campaign_;
  std::vector<RunResult> results_;
  std::map<std::string, Check, std::less<>> checks_;
};

}  // namespace proofmass::test
