#include <gtest/gtest.h>

#include <cstdio>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "coordinator/cli/commands/watch.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "coordinator/cli/watch_display.hpp"

namespace proofmass::coordinator {
namespace {

using wire::CampaignPhase;

wire::StatusReply status_of(const std::vector<std::pair<std::string, CampaignPhase>>& campaigns) {
  wire::StatusReply status;
  for (const auto& [name, phase] : campaigns) {
    wire::CampaignStatus campaign;
    campaign.name = name;
    campaign.phase = phase;
    campaign.num_runs = 10;
    status.campaigns.push_back(campaign);
  }
  return status;
}

/// How a watch went whose questions are answered with the replies, one after the other.
struct Watched {
  int exit_code = -1;
  std::size_t num_questions = 0;
  std::size_t num_pauses = 0;
};

Watched watch(const std::vector<wire::ClientReply>& replies,
              const std::optional<std::string>& campaign = std::nullopt) {
  std::FILE* const file = std::tmpfile();
  WatchDisplay display(WatchMode::lines, file);
  Watched watched;
  const Ask ask = [&](const wire::ClientRequest& request) {
    EXPECT_TRUE(std::holds_alternative<wire::StatusRequest>(request));
    return replies.at(watched.num_questions++);
  };
  watched.exit_code =
      watch_until_over(ask, campaign, display, [&watched] { ++watched.num_pauses; });
  std::fclose(file);
  return watched;
}

TEST(Watch, EndsWhenAllCampaignsAreFinished) {
  const Watched watched =
      watch({status_of({{"a", CampaignPhase::active}, {"b", CampaignPhase::active}}),
             status_of({{"a", CampaignPhase::finished}, {"b", CampaignPhase::paused}}),
             status_of({{"a", CampaignPhase::finished}, {"b", CampaignPhase::finished}})});
  EXPECT_EQ(watched.exit_code, exit_done);
  EXPECT_EQ(watched.num_questions, 3U);
  EXPECT_EQ(watched.num_pauses, 2U);
}

TEST(Watch, EndsWhenTheNamedCampaignIsFinished) {
  const Watched watched = watch({status_of({{"a", CampaignPhase::cancelled},
                                            {"b", CampaignPhase::finished},
                                            {"c", CampaignPhase::active}})},
                                "b");
  EXPECT_EQ(watched.exit_code, exit_done);
  EXPECT_EQ(watched.num_questions, 1U);
}

TEST(Watch, FailsIfACampaignIsCancelled) {
  EXPECT_EQ(watch({status_of({{"a", CampaignPhase::finished}, {"b", CampaignPhase::cancelled}})})
                .exit_code,
            exit_cannot_be_done);
}

TEST(Watch, EndsAtOnceWithoutCampaigns) {
  const Watched watched = watch({wire::StatusReply{}});
  EXPECT_EQ(watched.exit_code, exit_done);
  EXPECT_EQ(watched.num_pauses, 0U);
}

std::string error_of(const wire::ClientReply& reply, const std::string& campaign) {
  try {
    (void)watch({reply}, campaign);
  } catch (const Error& error) {
    return error.what();
  }
  return "none";
}

TEST(Watch, SaysWhichCampaignsThereAre) {
  EXPECT_EQ(
      error_of(status_of({{"a", CampaignPhase::active}, {"b", CampaignPhase::active}}), "hardy"),
      "campaign = hardy (there is a, b)");
  EXPECT_EQ(error_of(wire::StatusReply{}, "hardy"), "campaign = hardy (there is none)");
}

TEST(Reply, OfAnotherKindIsAnError) {
  EXPECT_EQ(error_of(wire::DoneReply{"x"}, "a"),
            "reply = of another kind (must be that of the request)");
}

TEST(Reply, ThatRefusesIsAnErrorInTheCoordinatorsWords) {
  EXPECT_EQ(error_of(wire::ErrorReply{"a = b (c)"}, "a"), "a = b (c)");
}

}  // namespace
}  // namespace proofmass::coordinator
