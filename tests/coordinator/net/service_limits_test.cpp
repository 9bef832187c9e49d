// What the key of a client may have unfinished, over real sockets.

#include <fmt/format.h>

#include "coordinator/net/campaign_files.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "proto/link/keys.hpp"
#include "tests/coordinator/net/plain_directory.hpp"
#include "tests/coordinator/net/playing_client.hpp"
#include "tests/coordinator/net/service_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using proto::ControlAction;

/// A campaign with a table of so many values.
MicroscopeCampaign with_table(const std::string& name, std::size_t num_runs) {
  MicroscopeCampaign campaign = test::campaign_of(name, num_runs);
  campaign.dispersions[5] = {.law = Law::table, .file = "f.csv", .column = "a"};
  campaign.table_columns = {std::vector<double>(num_runs, 1e-3)};
  return campaign;
}

/// A service with the client's key of Anna, to whom one unfinished campaign is allowed.
class ServiceLimits : public test::ServiceTest {
 protected:
  ServiceLimits() : keys(directory / "keys") {
    std::filesystem::create_directory(keys);
    wire::write_key_pair(keys, "coordinator", wire::KeyRole::coordinator, coordinator_keys);
    std::ofstream(keys / "authorized_workers");
    std::ofstream(keys / "authorized_clients") << client_keys.public_key.text() << " anna\n";
    config.workers_endpoint = "tcp://127.0.0.1:*";
    config.clients_endpoint = "tcp://127.0.0.1:*";
    config.keys = keys;
    config.limits.campaigns_max = 1;
  }
  ~ServiceLimits() override { end(StopRequest::now); }  // It reads the directory until then.

  void start_with(const std::vector<MicroscopeCampaign>& campaigns) {
    start(campaigns);
    client.emplace(
        service->clients_endpoint(),
        wire::ClientSecurity{.identity = wire::CurveIdentity{
                                 .keys = client_keys, .coordinator = coordinator_keys.public_key}});
  }

  /// A campaign of Anna's of two runs, all of which were given up.
  void make_given_up_file(const std::string& name) {
    ServedCampaign campaign = files.open(test::campaign_of(name, 2), {}, anna);
    const std::vector<Entry> entries{GivenUpRun{RunIndex{0}}, GivenUpRun{RunIndex{1}},
                                     CampaignControl{.phase = wire::CampaignPhase::finished}};
    (void)campaign.store.write(entries);
  }
  void make_cancelled_file(const std::string& name) {
    ServedCampaign campaign = files.open(test::campaign_of(name, 2), {}, anna);
    const Entry cancelled = CampaignControl{.phase = wire::CampaignPhase::cancelled};
    (void)campaign.store.write({&cancelled, 1});
  }

  std::string submit(const MicroscopeCampaign& campaign) {
    return client->done(test::submission(definition_of(campaign)));
  }
  std::string submit(const std::string& name, std::uint64_t num_runs = 2) {
    return submit(test::campaign_of(name, num_runs));
  }
  std::string control(ControlAction action, const std::string& name) {
    return client->done(test::control(action, name));
  }

  [[nodiscard]] std::vector<std::string> kinds_of_events(const std::string& file) const {
    std::vector<std::string> kinds;
    for (const StoredEvent& event : Store::open_read_only(directory / file).events_after(0, 100)) {
      kinds.push_back(event.kind);
    }
    return kinds;
  }

  const std::string too_many =
      "error: campaigns = 2 (must be at most 1 unfinished ones of the key anna; cancel one, or "
      "wait)";
  const Asker anna{.name = "anna", .rights = usual_rights};
  const wire::KeyPair coordinator_keys = wire::make_key_pair();
  const wire::KeyPair client_keys = wire::make_key_pair();
  std::filesystem::path keys;
  test::PlainDirectory folder{directory};
  std::optional<test::PlayingClient> client;
};

TEST_F(ServiceLimits, HoldForCancelledCampaignsThatAreResumed) {
  start_with({});
  EXPECT_THAT(submit("a"), StartsWith("campaign a: active"));
  EXPECT_EQ(submit("b"), too_many);
  EXPECT_THAT(control(proto::CONTROL_ACTION_CANCEL, "a"), StartsWith("campaign a: cancelled"));
  EXPECT_THAT(submit("b"), StartsWith("campaign b: active"));
  EXPECT_EQ(control(proto::CONTROL_ACTION_RESUME, "a"), too_many);
  EXPECT_EQ(submit("a"), too_many);
  EXPECT_THAT(control(proto::CONTROL_ACTION_PAUSE, "b"), StartsWith("campaign b: paused"));
  EXPECT_THAT(control(proto::CONTROL_ACTION_RESUME, "b"), StartsWith("campaign b: active"));
  EXPECT_THAT(control(proto::CONTROL_ACTION_CANCEL, "b"), StartsWith("campaign b: cancelled"));
  EXPECT_THAT(control(proto::CONTROL_ACTION_RESUME, "a"), StartsWith("campaign a: active"));
}

// Each database has the history of its own campaign.
TEST_F(ServiceLimits, AreOfAKeyWhoseChangesAreNoted) {
  config.directory = &folder;
  start_with({});
  EXPECT_THAT(submit("a", 3), StartsWith("campaign a: active"));
  EXPECT_EQ(wait_for_event("campaign_changed request=submit"),
            "campaign_changed request=submit runs=3 by=anna campaign=a");
  EXPECT_EQ(submit("b"), too_many);
  (void)client->done(test::control(proto::CONTROL_ACTION_SET_PRIORITY, "a", -3));
  EXPECT_EQ(wait_for_event("campaign_changed request=set-priority"),
            "campaign_changed request=set-priority priority=-3 by=anna campaign=a");
  (void)control(proto::CONTROL_ACTION_CANCEL, "a");
  EXPECT_THAT(submit("b"), StartsWith("campaign b: active"));
  EXPECT_THAT(control(proto::CONTROL_ACTION_ARCHIVE, "a"), StartsWith("campaign a: its database"));
  EXPECT_EQ(wait_for_event("campaign_changed request=archive"),
            "campaign_changed request=archive by=anna campaign=a");
  end(StopRequest::now);
  EXPECT_THAT(kinds_of_events("a.archived"),
              ElementsAre("campaign_changed", "campaign_changed", "campaign_changed"));
  EXPECT_THAT(kinds_of_events("b.db"), ElementsAre("campaign_changed"));
}

TEST_F(ServiceLimits, HoldForRunsThatAreRetried) {
  make_given_up_file("a");
  start_with({test::campaign_of("a", 2)});
  EXPECT_THAT(submit("b"), StartsWith("campaign b: active"));
  EXPECT_EQ(control(proto::CONTROL_ACTION_RETRY, "a"), too_many);
  EXPECT_THAT(control(proto::CONTROL_ACTION_CANCEL, "b"), StartsWith("campaign b: cancelled"));
  EXPECT_THAT(control(proto::CONTROL_ACTION_RETRY, "a"), StartsWith("campaign a: active"));
}

TEST_F(ServiceLimits, HoldForMoreRunsOfAFinishedCampaign) {
  make_given_up_file("a");
  start_with({test::campaign_of("a", 2)});
  EXPECT_THAT(submit("b"), StartsWith("campaign b: active"));
  EXPECT_EQ(submit("a", 3), too_many);
  EXPECT_THAT(submit("a", 2), StartsWith("campaign a: failed"));  // Nothing begins again.
  EXPECT_THAT(control(proto::CONTROL_ACTION_CANCEL, "b"), StartsWith("campaign b: cancelled"));
  EXPECT_THAT(submit("a", 3), StartsWith("campaign a: active"));
}

TEST_F(ServiceLimits, HoldForALargerDefinitionOfAnUnfinishedCampaign) {
  const std::uint64_t size = definition_size(with_table("a", 10));
  const std::uint64_t larger_size = definition_size(with_table("a", 20));
  config.limits.size_max = size;
  start_with({});
  EXPECT_THAT(submit(with_table("a", 10)), StartsWith("campaign a: active"));
  EXPECT_EQ(submit(with_table("a", 20)),
            fmt::format("error: definitions size = {} bytes (must be at most {} of the unfinished "
                        "campaigns of the key anna; cancel one, or wait)",
                        larger_size, size));
  EXPECT_THAT(submit(with_table("a", 10)), StartsWith("campaign a: active, 10 runs"));
}

TEST_F(ServiceLimits, HoldForClosedCampaigns) {
  config.directory = &folder;
  make_given_up_file("a");
  make_cancelled_file("b");
  start_with({});
  EXPECT_THAT(submit("c"), StartsWith("campaign c: active"));
  EXPECT_EQ(control(proto::CONTROL_ACTION_RETRY, "a"), too_many);
  EXPECT_EQ(control(proto::CONTROL_ACTION_RESUME, "b"), too_many);
  EXPECT_THAT(control(proto::CONTROL_ACTION_CANCEL, "c"), StartsWith("campaign c: cancelled"));
  EXPECT_THAT(control(proto::CONTROL_ACTION_RESUME, "b"), StartsWith("campaign b: active"));
  EXPECT_EQ(control(proto::CONTROL_ACTION_RETRY, "a"), too_many);
}

TEST_F(ServiceLimits, HoldForTheDefinitionsOfClosedCampaigns) {
  config.directory = &folder;
  config.limits.campaigns_max = 2;
  const std::uint64_t size = definition_size(test::campaign_of("b", 2));
  config.limits.size_max = 2 * size - 1;
  make_cancelled_file("b");
  start_with({});
  EXPECT_THAT(submit("c"), StartsWith("campaign c: active"));
  EXPECT_EQ(control(proto::CONTROL_ACTION_RESUME, "b"),
            fmt::format("error: definitions size = {} bytes (must be at most {} of the unfinished "
                        "campaigns of the key anna; cancel one, or wait)",
                        2 * size, 2 * size - 1));
  EXPECT_EQ(Store::open_read_only(directory / "b.db").control().phase,
            wire::CampaignPhase::cancelled);
  EXPECT_THAT(control(proto::CONTROL_ACTION_CANCEL, "c"), StartsWith("campaign c: cancelled"));
  EXPECT_THAT(control(proto::CONTROL_ACTION_RESUME, "b"), StartsWith("campaign b: active"));
}

}  // namespace
}  // namespace proofmass::coordinator
