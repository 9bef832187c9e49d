#include "coordinator/net/request.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <variant>

#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/message_of.hpp"

namespace proofmass::coordinator {
namespace {

wire::SubmitRequest some_submit() {
  MicroscopeCampaign campaign;
  campaign.name = "tables";
  campaign.num_runs = 2;
  campaign.dispersions[5] = {.law = Law::table, .file = "f.csv", .column = "a"};
  campaign.table_columns = {{0.1, -2.0 / 3.0}};
  return {.definition = definition_of(campaign),
          .priority = -7,
          .audit_fraction = 0.1,
          .stop_rule = "std(a_c13) within 5%",
          .failures_max = 3};
}

TEST(RequestOf, HasTheCampaignThatTheDefinitionSays) {
  const auto submission = std::get<Submission>(request_of(some_submit()));
  EXPECT_EQ(submission.campaign->definition(TableColumns::included), some_submit().definition);
  EXPECT_EQ(submission.campaign->table_columns[0][1], -2.0 / 3.0);
  EXPECT_EQ(submission.priority, -7);
  EXPECT_EQ(submission.audit_fraction, 0.1);
  EXPECT_EQ(submission.stop_rule, "std(a_c13) within 5%");
  EXPECT_EQ(submission.failures_max, 3U);
}

TEST(RequestOf, HasAllElseAsItCame) {
  const auto control = std::get<wire::ControlRequest>(
      request_of(wire::ControlRequest{.action = wire::ControlAction::cancel, .campaign = "a"}));
  EXPECT_EQ(control.action, wire::ControlAction::cancel);
  EXPECT_EQ(control.campaign, "a");
}

TEST(RequestOf, RefusesADefinitionThatIsNone) {
  const auto refusal = [](const std::function<void(Definition&)>& change) {
    wire::SubmitRequest submit = some_submit();
    change(submit.definition);
    return test::message_of<DefinitionError>([&] { (void)request_of(submit); });
  };
  EXPECT_EQ(refusal([](Definition& d) { d.text.insert(0, "x = 1\n"); }),
            "definition:1: x = 1 (unknown key)");
  EXPECT_EQ(refusal([](Definition& d) { d.text.replace(d.text.find("tables"), 6, "../a"); }),
            "definition:2: campaign.name = \"../a\" (must be 1 to 64 letters, digits, _, - or .)");
  EXPECT_NE(refusal([](Definition& d) { d.table_columns.clear(); }), "");
  EXPECT_NE(refusal([](Definition& d) { d.table_columns[0].pop_back(); }), "");
}

}  // namespace
}  // namespace proofmass::coordinator
