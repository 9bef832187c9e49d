// How a worker gets the definitions of campaigns of which it was lent runs.

#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/worker/net/conversation_fixture.hpp"

namespace proofmass::worker {
namespace {

TEST_F(ConversationTest, AsksNoMoreForACampaignWithoutRuns) {
  start();
  register_here();
  receive(lease(0, 1));
  (void)take_sent<proto::CampaignRequest>();
  receive(test::make_retract(campaign_1, {{{0}, 1}}));
  (void)take_sent<proto::GiveBack>();
  tick_after(1500ms);
  receive(definition(campaign_1));
  EXPECT_FALSE(execution.is_defined(campaign_1));
}

/// Of more than one part, as far as the conversation is concerned.
std::vector<proto::DefinitionPart> split(const proto::DefinitionPart& whole) {
  proto::DefinitionPart first = whole;
  proto::DefinitionPart second = whole;
  first.mutable_content()->resize(100);
  second.mutable_content()->erase(0, 100);
  second.set_offset(100);
  return {first, second};
}

TEST_F(ConversationTest, BeginsADefinitionAnewThatHasChanged) {
  start();
  register_here();
  receive(lease(0, 1));
  (void)take_sent<proto::CampaignRequest>();
  MicroscopeCampaign extended;
  extended.num_runs += 1;
  const auto old_parts = split(definition(campaign_1));
  const auto new_parts = split(definition(campaign_1, extended));
  receive(old_parts[0]);
  (void)take_sent<proto::CampaignRequest>();
  receive(new_parts[1]);
  EXPECT_EQ(take_sent<proto::CampaignRequest>().offset(), 0U);
  receive(new_parts[0]);
  EXPECT_EQ(take_sent<proto::CampaignRequest>().offset(), 100U);
  receive(new_parts[1]);
  EXPECT_TRUE(execution.is_defined(campaign_1));
}

TEST_F(ConversationTest, AsksAgainForADefinitionThatMakesNoSense) {
  start();
  register_here();
  receive(lease(0, 1));
  (void)take_sent<proto::CampaignRequest>();
  proto::DefinitionPart damaged = definition(campaign_1);
  damaged.mutable_content()->front() ^= 1;
  receive(damaged);
  EXPECT_FALSE(execution.is_defined(campaign_1));
  for (int i = 0; i < 59; ++i) {
    tick_after(1s);
    std::erase_if(sent, [](const proto::Envelope& message) { return message.has_heartbeat(); });
    EXPECT_TRUE(sent.empty()) << i;
  }
  tick_after(1s);
  EXPECT_EQ(take_sent<proto::CampaignRequest>().offset(), 0U);
  sent.clear();
  receive(definition(campaign_1));
  EXPECT_TRUE(execution.is_defined(campaign_1));
}

std::vector<std::string> take_events(Conversation& conversation) {
  std::vector<std::string> texts;
  for (const wire::Event& event : conversation.take_events()) texts.push_back(to_text(event));
  return texts;
}

// Whole as it was sent, but not what a coordinator of this program says.
TEST_F(ConversationTest, RefusesADefinitionThatIsNotCanonical) {
  start();
  register_here();
  receive(lease(0, 1));
  (void)take_sent<proto::CampaignRequest>();
  Definition other = definition_of(MicroscopeCampaign{});
  other.text.insert(0, "# \u00e9\n");
  receive(wire::EncodedDefinition(other).part(campaign_1, 0));
  EXPECT_FALSE(execution.is_defined(campaign_1));
  EXPECT_EQ(take_events(*conversation),
            std::vector<std::string>{"malformed_definition campaign=0000000000000001 definition:1: "
                                     "line = \"# \u00e9\" (must be \"[campaign]\", as the "
                                     "definition has one spelling)"});
  // Its name stands in the refusal, which is cut.
  other = definition_of(MicroscopeCampaign{});
  const std::string table = "[environment]\n";
  other.text.insert(other.text.find(table) + table.size(),
                    "file = \"" + std::string(1000, 'x') + "\"\n");
  tick_after(60s);
  sent.clear();  // It has asked again.
  receive(wire::EncodedDefinition(other).part(campaign_1, 0));
  EXPECT_LT(take_events(*conversation).at(0).size(), 500U);
  receive(definition(campaign_1));
  EXPECT_TRUE(execution.is_defined(campaign_1));
}

MicroscopeCampaign definition_with_table() {
  MicroscopeCampaign campaign;
  campaign.dispersions[0] = {.law = Law::table, .file = "f", .column = "c"};
  return campaign;
}

TEST_F(ConversationTest, EndsIfALeaseLacksTableValues) {
  start();
  register_here();
  receive(lease(0, 2));
  (void)take_sent<proto::CampaignRequest>();
  receive(definition(campaign_1, definition_with_table()));
  expect_ending(Ending::Kind::failed, "table_values = 1 for each run (must be 0)");
}

TEST_F(ConversationTest, EndsIfALeaseHasOtherTableValuesThanTheOneBefore) {
  start();
  register_here();
  const proto::RunLease two = test::make_lease(campaign_1, {{0}, 2}, {1}, {1.5, 2.5});
  receive(two);
  (void)take_sent<proto::CampaignRequest>();
  receive(definition(campaign_1, definition_with_table()));
  EXPECT_FALSE(conversation->ending().has_value());
  receive(lease(2, 1));
  expect_ending(Ending::Kind::failed, "table_values = 0 for each run (must be 1)");
}

}  // namespace
}  // namespace proofmass::worker
