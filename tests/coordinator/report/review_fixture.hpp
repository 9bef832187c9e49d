#pragma once

#include "coordinator/report/review.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::test {

inline const std::string hostile_text =
    "<script>alert(1)</script> \"quoted\" 'single' & | `code` \x1b[31m";

/// A run whose errors are this many of its standard errors, which are a tenth of the objectives.
inline RunResult result_off_by(std::uint64_t run, double pull) {
  RunResult result = result_of(run);
  const std::vector<double> objectives = campaign_of(1).objectives();
  for (std::size_t i = 0; i < objectives.size(); ++i) {
    result.truth[i] = 0.0;
    result.estimate[i] = 0.1 * pull * objectives[i];
    result.standard_error.push_back(0.1 * objectives[i]);
  }
  result.fit = {30.0 + static_cast<double>(run), 32.0};
  result.correlations.assign(45, 0.0);
  return result;
}

/// A campaign database with results whose errors are known: run r is off by (r + 1) % of the
/// objective in each parameter.
class ReviewTest : public StoreTest {
 protected:
  [[nodiscard]] coordinator::Store store_with(std::uint64_t num_runs) const {
    const MicroscopeCampaign campaign = campaign_of(num_runs);
    coordinator::Store store =
        coordinator::Store::create(file(), campaign, canonical_definition(campaign));
    const std::vector<double> objectives = campaign.objectives();
    std::vector<coordinator::Entry> entries;
    coordinator::WorkerJoined worker = worker_1();
    worker.host = worker.cards = hostile_text;
    entries.emplace_back(worker);
    for (std::uint64_t run = 0; run < num_runs; ++run) {
      coordinator::Delivery delivery = delivery_of(run);
      for (std::size_t i = 0; i < objectives.size(); ++i) {
        delivery.result.truth[i] = 0.0;
        delivery.result.estimate[i] = objectives[i] * static_cast<double>(run + 1) / 100.0;
      }
      entries.emplace_back(delivery);
    }
    store.write(entries);
    return store;
  }

  [[nodiscard]] static coordinator::Review review_of(
      const coordinator::Store& store, std::uint64_t num_runs,
      std::vector<coordinator::StatedRequirement> stated = {}) {
    coordinator::Review review = coordinator::read_review(
        store, campaign_of(num_runs), coordinator::ReviewDepth::charts, std::move(stated));
    review.database = "a campaign.db";
    return review;
  }
};

}  // namespace proofmass::test
