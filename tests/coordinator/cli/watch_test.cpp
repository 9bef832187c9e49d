#include <cstdio>

#include "coordinator/cli/client.hpp"
#include "coordinator/cli/program.hpp"
#include "core/error.hpp"
#include "proto/wire/names.hpp"
#include "tests/coordinator/cli/display_output.hpp"
#include "tests/proto/wire/requests.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using test::output_of;

proto::StatusReply status_of(const std::string& name, std::uint64_t num_done) {
  return test::status_with({test::campaign_status(name, num_done, 100)});
}

TEST(Drawing, TakesThePlaceOfTheOneBefore) {
  const Drawing first = drawn_over(0, "a\nb\n", {.rows = 24});
  EXPECT_EQ(first.text, "a\033[K\nb\033[K\n\033[J");
  EXPECT_EQ(first.num_lines, 2U);
  const Drawing second = drawn_over(first.num_lines, "c\n", {.rows = 24});
  EXPECT_EQ(second.text, "\033[2Ac\033[K\n\033[J");
  EXPECT_EQ(second.num_lines, 1U);
}

TEST(Drawing, SaysHowManyLinesItLeavesOut) {
  const Drawing drawing = drawn_over(0, "a\nb\nc\nd", {.rows = 4});
  EXPECT_EQ(drawing.text, "a\033[K\nb\033[K\nand 2 more lines\033[K\n\033[J");
  EXPECT_EQ(drawing.num_lines, 3U);
}

TEST(Drawing, NeedsNoEndOfTheLastLine) {
  EXPECT_EQ(drawn_over(0, "a", {.rows = 24}).text, "a\033[K\n\033[J");
}

// A row that the terminal wraps would take two of it, and the next drawing would begin too low.
TEST(Drawing, CutsLinesThatAreTooWideAndKeepsTheirColours) {
  const ScreenSize narrow{.columns = 6};
  EXPECT_EQ(drawn_over(0, "abcdef\nabcde", narrow).text, "abcd…\033[K\nabcde\033[K\n\033[J");
  EXPECT_EQ(drawn_over(0, "ab\033[1mcdef\033[0mgh", narrow).text,
            "ab\033[1mcd…\033[0m\033[K\n\033[J");
}

TEST(ScreenSize, IsTheUsualOneWhereThereIsNoTerminal) {
  std::FILE* const file = std::tmpfile();
  const ScreenSize size = screen_size_of(file);
  std::fclose(file);
  EXPECT_EQ(size.columns, 80U);
  EXPECT_EQ(size.rows, 24U);
}

TEST(LineWidth, HasNoLimitWhereThereIsNoTerminal) {
  std::FILE* const file = std::tmpfile();
  EXPECT_EQ(style_of(file).line_width_max, std::numeric_limits<std::size_t>::max());
  std::fclose(file);
}

// A small screen leaves out the last lines.
TEST(WatchDisplay, ShowsCampaignsThatAreOverLast) {
  proto::StatusReply status = status_of("over", 100);
  status.mutable_campaigns(0)->set_phase(proto::CAMPAIGN_PHASE_FINISHED);
  *status.add_campaigns() = test::campaign_status("open", 1, 100);
  const std::string text = output_of<WatchDisplay>(
      WatchMode::screen, [&](WatchDisplay& display) { display.update(status); });
  EXPECT_LT(text.find("\nopen"), text.find("\nover"));
}

TEST(WatchDisplay, WritesALineEveryTenPercent) {
  const std::string text = output_of<WatchDisplay>(WatchMode::lines, [](WatchDisplay& display) {
    for (std::uint64_t i = 0; i <= 30; ++i) display.update(status_of("a", i));
  });
  EXPECT_EQ(text,
            "a active: 0 of 100 runs, 0 %\n"
            "a active: 10 of 100 runs, 10 %\n"
            "a active: 20 of 100 runs, 20 %\n"
            "a active: 30 of 100 runs, 30 %\n");
}

TEST(WatchDisplay, WritesALineWhenSomethingHappens) {
  const std::string text = output_of<WatchDisplay>(WatchMode::lines, [](WatchDisplay& display) {
    proto::StatusReply status = status_of("a", 1);
    for (int i = 0; i < 2; ++i) display.update(status);
    status.mutable_campaigns(0)->set_phase(proto::CAMPAIGN_PHASE_PAUSED);
    for (int i = 0; i < 2; ++i) display.update(status);
    status.mutable_campaigns(0)->set_num_given_up(1);
    for (int i = 0; i < 2; ++i) display.update(status);
    status.mutable_campaigns(0)->set_num_mismatches(1);
    for (int i = 0; i < 2; ++i) display.update(status);
    status.mutable_campaigns(0)->set_storage_failure("disk full");
    for (int i = 0; i < 2; ++i) display.update(status);
  });
  EXPECT_EQ(std::ranges::count(text, '\n'), 5);
}

TEST(WatchDisplay, KeepsCampaignsApart) {
  const std::string text = output_of<WatchDisplay>(WatchMode::lines, [](WatchDisplay& display) {
    proto::StatusReply status = status_of("a", 1);
    *status.add_campaigns() = test::campaign_status("b", 2, 100);
    for (int i = 0; i < 3; ++i) display.update(status);
  });
  EXPECT_EQ(text, "a active: 1 of 100 runs, 1 %\nb active: 2 of 100 runs, 2 %\n");
}

TEST(WatchDisplay, DrawsTheTableAgain) {
  const std::string text = output_of<WatchDisplay>(WatchMode::screen, [](WatchDisplay& display) {
    for (int i = 0; i < 2; ++i) display.update(status_of("a", 1));
  });
  EXPECT_EQ(text.find("\033[6A"), text.find("\033[J") + 3);
}

// It would go on for as long as the campaign does.
TEST(WatchDisplay, EndsIfItCannotBeWritten) {
  std::FILE* const file = std::fopen("/dev/full", "w");
  ASSERT_NE(file, nullptr);
  WatchDisplay display(WatchMode::json, file);
  EXPECT_EQ(test::message_of<Error>([&] { display.update(status_of("a", 1)); }),
            "standard output: No space left on device");
  std::fclose(file);
}

TEST(WatchDisplay, WritesAnObjectALine) {
  const std::string text = output_of<WatchDisplay>(WatchMode::json, [](WatchDisplay& display) {
    for (int i = 0; i < 3; ++i) display.update(status_of("a", 1));
  });
  EXPECT_EQ(std::ranges::count(text, '\n'), 3);
  EXPECT_TRUE(text.starts_with(R"({"version":"v",)"));
}

}  // namespace

namespace {

using wire::CampaignPhase;

proto::ReplyEnvelope status_reply(
    const std::vector<std::pair<std::string, CampaignPhase>>& campaigns) {
  std::vector<proto::CampaignStatus> statuses;
  for (const auto& [name, phase] : campaigns) {
    statuses.push_back(test::campaign_status(name, 0, 10, wire::message_value(phase)));
  }
  return test::reply_with(test::status_with(statuses));
}

/// How a watch went whose questions are answered with the replies, one after the other.
struct Watched {
  int exit_code = -1;
  std::size_t num_questions = 0;
  std::size_t num_pauses = 0;
};

Watched watch(const std::vector<proto::ReplyEnvelope>& replies,
              const std::optional<std::string>& campaign = std::nullopt) {
  std::FILE* const file = std::tmpfile();
  WatchDisplay display(WatchMode::lines, file);
  Watched watched;
  const Ask ask = [&](const proto::RequestEnvelope& request) {
    EXPECT_TRUE(request.has_status());
    return replies.at(watched.num_questions++);
  };
  watched.exit_code =
      watch_until_over(ask, campaign, display, [&watched] { ++watched.num_pauses; });
  std::fclose(file);
  return watched;
}

TEST(Watch, EndsWhenAllCampaignsAreFinished) {
  const Watched watched =
      watch({status_reply({{"a", CampaignPhase::active}, {"b", CampaignPhase::active}}),
             status_reply({{"a", CampaignPhase::finished}, {"b", CampaignPhase::paused}}),
             status_reply({{"a", CampaignPhase::finished}, {"b", CampaignPhase::finished}})});
  EXPECT_EQ(watched.exit_code, exit_done);
  EXPECT_EQ(watched.num_questions, 3U);
  EXPECT_EQ(watched.num_pauses, 2U);
}

TEST(Watch, EndsAtOnceWithoutCampaigns) {
  const Watched watched = watch({status_reply({})});
  EXPECT_EQ(watched.exit_code, exit_done);
  EXPECT_EQ(watched.num_pauses, 0U);
}

std::string error_of(const proto::ReplyEnvelope& reply, const std::string& campaign) {
  try {
    (void)watch({reply}, campaign);
  } catch (const Error& error) {
    return error.what();
  }
  return "none";
}

TEST(Reply, OfAnotherKindIsAnError) {
  EXPECT_EQ(error_of(wire::done_reply("x"), "a"),
            "reply = of another kind (must be that of the request)");
}

}  // namespace
}  // namespace proofmass::coordinator
