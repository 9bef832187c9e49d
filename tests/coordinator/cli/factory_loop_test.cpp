// `proofmass factory` against a coordinator that the test plays.

#include <CLI/CLI.hpp>

#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/net/private_endpoint.hpp"
#include "proto/wire/client_codec.hpp"
#include "tests/coordinator/net/played_coordinator.hpp"
#include "tests/proto/wire/requests.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

/// Runs the command against the endpoint; its exit code.
int exit_code_of_factory(const std::string& endpoint) {
  std::vector<std::string> arguments{
      "factory",      "--batch-system", "local", "--connect", endpoint, "--worker-connect",
      "tcp://head:2", "--interval",     "1",     "--name",    "lone",   "--exit-when-done"};
  std::ranges::reverse(arguments);  // As CLI11 takes them.
  CLI::App app("", "proofmass");
  Command chosen;
  add_factory(app, chosen);
  app.parse(arguments);
  return chosen();
}

/// Answers one look as a coordinator does that does not know reports.
void answer_look(test::PlayedCoordinator& coordinator, proto::CampaignPhase phase) {
  coordinator.answer(
      coordinator.receive().request_id(),
      test::reply_with(test::status_with({test::campaign_status("a", 0, 1, phase)})));
  coordinator.answer(coordinator.receive().request_id(),
                     test::reply_with(std::vector<proto::WorkerStatus>{}));
  EXPECT_TRUE(coordinator.receive().has_factory_report());
  coordinator.answer(0, wire::error_reply("request = none (must be of a known kind)"));
}

TEST(FactoryLoop, GoesOnWithACoordinatorThatDoesNotKnowReports) {
  const PrivateEndpoint endpoint;
  test::PlayedCoordinator coordinator(endpoint.address());
  testing::internal::CaptureStderr();
  auto exit_code =
      std::async(std::launch::async, [&] { return exit_code_of_factory(endpoint.address()); });
  answer_look(coordinator, proto::CAMPAIGN_PHASE_PAUSED);
  answer_look(coordinator, proto::CAMPAIGN_PHASE_PAUSED);
  answer_look(coordinator, proto::CAMPAIGN_PHASE_FINISHED);
  EXPECT_EQ(exit_code.get(), exit_done);
  const std::string log = testing::internal::GetCapturedStderr();
  EXPECT_THAT(log, HasSubstr("report_refused reason=\"request = none (must be of a known kind)\""));
  EXPECT_EQ(log.find("report_refused"), log.rfind("report_refused")) << log;
}

}  // namespace
}  // namespace proofmass::coordinator
