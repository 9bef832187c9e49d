// The clients' commands against a service, over real sockets, with keys and without.

#include <gmock/gmock.h>

#include <chrono>
#include <fstream>
#include <functional>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/cli/campaign_databases.hpp"
#include "coordinator/cli/client.hpp"
#include "coordinator/cli/program.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/coordinator/cli/program.hpp"
#include "tests/coordinator/net/service_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using ::testing::HasSubstr;
using wire::CampaignPhase;
using wire::ControlAction;

class ClientCommands : public test::ServiceTest {
 protected:
  ClientCommands() { config.clients_endpoint = "tcp://127.0.0.1:*"; }

  void use_keys() {
    ASSERT_EQ(test::answer_of({"keygen", directory / "keys"}).exit_code, exit_done);
    config.keys = directory / "keys";
  }

  ClientOptions options() const {
    ClientOptions options;
    options.connection = {.endpoint = service->clients_endpoint(),
                          .keys = config.keys,
                          .is_plain_waived = false,
                          .reply_wait = std::chrono::seconds(20)};
    return options;
  }

  /// Submits, asks, pauses, resumes and cancels one campaign.
  void control_a_campaign() {
    start({});
    (void)with_connection(options(), [](const Ask& ask) {
      const auto control = [&](ControlAction action) {
        return reply_of<wire::DoneReply>(ask, wire::ControlRequest{action, "new"}).text;
      };
      const auto phase = [&] {
        const auto status = reply_of<wire::StatusReply>(ask, wire::StatusRequest{});
        return status.campaigns.at(0).phase;
      };
      const wire::SubmitRequest submit{.definition = definition_of(test::campaign_of("new", 5)),
                                       .priority = 3,
                                       .audit_fraction = 0.5};
      EXPECT_THAT(reply_of<wire::DoneReply>(ask, submit).text, HasSubstr("campaign new"));
      EXPECT_EQ(phase(), CampaignPhase::active);
      EXPECT_THAT(control(ControlAction::pause), HasSubstr("campaign new"));
      EXPECT_EQ(phase(), CampaignPhase::paused);
      (void)control(ControlAction::resume);
      EXPECT_EQ(phase(), CampaignPhase::active);
      (void)control(ControlAction::cancel);
      EXPECT_EQ(phase(), CampaignPhase::cancelled);
      EXPECT_TRUE(reply_of<wire::WorkersReply>(ask, wire::WorkersRequest{}).workers.empty());
      return exit_done;
    });
  }
};

std::string error_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "none";
}

TEST_F(ClientCommands, ControlACampaign) { control_a_campaign(); }

TEST_F(ClientCommands, ControlACampaignWithKeys) {
  use_keys();
  control_a_campaign();
}

TEST_F(ClientCommands, PrintWhatTheCoordinatorSays) {
  start({});
  std::ofstream(directory / "mine.toml") << "[campaign]\nname = \"mine\"\nruns = 7\n";
  const auto answer = test::answer_of(
      {"submit", directory / "mine.toml", "--connect", service->clients_endpoint()});
  EXPECT_EQ(answer.exit_code, exit_done) << answer.error;
  EXPECT_EQ(answer.output, "campaign mine: active, 7 runs, 0 of them done\n");
}

TEST_F(ClientCommands, SubmitWhatTheArgumentsReplace) {
  CampaignFolder folder(directory / "served");
  config.files = &folder;
  start({});
  std::ofstream(directory / "mine.toml") << "[campaign]\nname = \"mine\"\nruns = 7\n";
  const auto answer =
      test::answer_of({"submit", directory / "mine.toml", "--connect", service->clients_endpoint(),
                       "--name", "other", "--priority", "3", "--audit", "0.25", "--runs", "9",
                       "--seed", "5", "--set", "noise.scale=0.5"});
  EXPECT_EQ(answer.output, "campaign other: active, 9 runs, 0 of them done\n") << answer.error;
  end(StopRequest::now);
  const Store store = Store::open_read_only(directory / "served/other.db");
  EXPECT_EQ(store.control().priority, 3);
  EXPECT_EQ(store.control().audit_fraction, 0.25);
  const auto campaign = std::dynamic_pointer_cast<const MicroscopeCampaign>(stored_campaign(store));
  EXPECT_EQ(campaign->seed, 5U);
  EXPECT_EQ(campaign->scenario.noise.scale, 0.5);
}

TEST_F(ClientCommands, CheckNamesBeforeAnythingIsSent) {
  std::ofstream(directory / "mine.toml") << "[campaign]\nname = \"mine\"\n";
  const std::vector<std::string> nowhere{"--connect", "tcp://127.0.0.1:1"};
  const auto refusal = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), nowhere.begin(), nowhere.end());
    const auto answer = test::answer_of(arguments);
    EXPECT_EQ(answer.exit_code, exit_wrong_usage);
    return answer.error;
  };
  EXPECT_EQ(
      refusal({"submit", directory / "mine.toml", "--name", "../other"}),
      "campaign.name = \"../other\" (must be 1 to 64 of [A-Za-z0-9._-], a letter or digit first)");
  EXPECT_EQ(refusal({"pause", "a b"}),
            "campaign = \"a b\" (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first)");
  EXPECT_EQ(refusal({"release", "a b"}),
            "host = \"a b\" (must be 1 to 128 of [A-Za-z0-9._-], a letter or digit first)");
}

TEST_F(ClientCommands, FailInTheCoordinatorsWords) {
  start({});
  const std::string error = error_of([&] {
    (void)with_connection(options(), [](const Ask& ask) {
      (void)reply_of<wire::DoneReply>(ask, wire::ControlRequest{ControlAction::pause, "other"});
      return exit_done;
    });
  });
  EXPECT_THAT(error, HasSubstr("campaign = other"));
}

TEST_F(ClientCommands, AreRefusedWithoutAKey) {
  use_keys();
  start({});
  ClientOptions without = options();
  without.connection.keys.reset();
  const std::string error = error_of([&] {
    (void)with_connection(without, [](const Ask& ask) {
      (void)ask(wire::StatusRequest{});
      return exit_done;
    });
  });
  EXPECT_THAT(error, HasSubstr("--keys"));
}

TEST_F(ClientCommands, AreRefusedWithAKeyThatIsNotOnTheList) {
  use_keys();
  start({});
  std::ofstream(directory / "keys" / "authorized_clients", std::ios::trunc) << "# nobody\n";
  std::string error;
  // The coordinator looks at the list once a second.
  for (int i = 0; i < 1000 && error.find("refused") == std::string::npos; ++i) {
    error = error_of([&] {
      (void)with_connection(options(), [](const Ask& ask) {
        (void)ask(wire::StatusRequest{});
        return exit_done;
      });
    });
  }
  EXPECT_THAT(error, HasSubstr("refused"));
  EXPECT_THAT(error, HasSubstr("authorized_clients"));
}

TEST_F(ClientCommands, ReportOfAFactoryWithTheRightToObserve) {
  use_keys();
  const auto list = directory / "keys" / "authorized_clients";
  const std::string all_rights = "observe,submit,control\n";
  std::string keys{std::istreambuf_iterator<char>(std::ifstream(list).rdbuf()), {}};
  ASSERT_TRUE(keys.ends_with(all_rights));
  keys.erase(keys.size() - all_rights.size());
  const auto reported_with = [&](const std::string& right) {
    std::ofstream(list) << keys << right << "\n";
    start({});
    std::string owner;
    const std::string error = error_of([&] {
      (void)with_connection(options(), [&](const Ask& ask) {
        (void)reply_of<wire::DoneReply>(
            ask, wire::FactoryReport{.name = "fleet", .batch_system = "pbs"});
        owner = reply_of<wire::StatusReply>(ask, wire::StatusRequest{}).factories.at(0).owner;
        return exit_done;
      });
    });
    end(StopRequest::now);
    return owner.empty() ? error : "reported by " + owner;
  };
  EXPECT_EQ(reported_with("observe"), "reported by client");
  EXPECT_EQ(
      reported_with("submit"),
      "key = client (must have the right `observe` in authorized_clients of the coordinator)");
}

TEST_F(ClientCommands, AreToldThatAnAddressIsForWorkers) {
  start({});
  ClientOptions wrong = options();
  wrong.connection.endpoint = service->workers_endpoint();
  wrong.connection.reply_wait = std::chrono::seconds(2);
  const std::string error = error_of([&] {
    (void)with_connection(wrong, [](const Ask& ask) {
      (void)ask(wire::StatusRequest{});
      return exit_done;
    });
  });
  EXPECT_THAT(error, HasSubstr("connect = " + wrong.connection.endpoint));
}

}  // namespace
}  // namespace proofmass::coordinator
