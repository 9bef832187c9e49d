#include "coordinator/cli/local_run.hpp"
#include "tests/coordinator/cli/display_output.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using test::output_of;

proto::CampaignStatus progress(std::uint64_t num_done, std::uint64_t num_runs, double rate_hz) {
  proto::CampaignStatus status;
  status.set_num_done(num_done);
  status.set_num_runs(num_runs);
  status.set_rate_hz(rate_hz);
  if (rate_hz > 0.0) status.set_remaining_s(static_cast<double>(num_runs - num_done) / rate_hz);
  return status;
}

TEST(Duration, IsWrittenInItsTwoLargestUnits) {
  EXPECT_EQ(duration_text(0.2), "1 s");
  EXPECT_EQ(duration_text(59.0), "59 s");
  EXPECT_EQ(duration_text(200.0), "3 min 20 s");
  EXPECT_EQ(duration_text(18600.0), "5 h 10 min");
  EXPECT_EQ(duration_text(1051200.0), "12 d 4 h");
  EXPECT_EQ(duration_text(1e300), "9999 d 0 h");
}

TEST(ProgressBar, ShowsRunsPercentRateAndTimeLeft) {
  EXPECT_EQ(progress_bar(progress(42, 100, 0.5), 79),
            "42/100 runs [###########.................]  42 %  0.500 runs/s  1 min 56 s left");
  EXPECT_EQ(progress_bar(progress(100, 100, 25.0), 62),
            "100/100 runs [############################] 100 %  25.0 runs/s");
}

TEST(ProgressBar, SaysThatTheFirstRunsAreComputed) {
  proto::CampaignStatus status = progress(0, 100, 0.0);
  status.set_num_lent(32);
  EXPECT_EQ(progress_bar(status, 60),
            "0/100 runs [.................]   0 %  computing the first 32");
  status.set_num_done(16);
  EXPECT_EQ(progress_line(status), "16/100 runs   16 %");
}

// What is done only grows, and so does the percentage, whenever a rule asks for more runs.
TEST(ProgressBar, DoesNotGoBackWhenAStopRuleAsksForMore) {
  EXPECT_EQ(progress_line(out_of(progress(768, 768, 10.0), 2000)),
            "768/2000 runs   38 %  10.0 runs/s  2 min 4 s left");
  EXPECT_EQ(progress_line(out_of(progress(768, 1024, 10.0), 2000)),
            "768/2000 runs   38 %  10.0 runs/s  2 min 4 s left");
  EXPECT_EQ(progress_line(out_of(progress(10, 20, 0.0), 20)), "10/20 runs   50 %");
}

TEST(ProgressBar, FillsTheLine) {
  for (const std::size_t columns_max : {59U, 79U, 199U}) {
    EXPECT_EQ(progress_bar(progress(42, 100, 0.0), columns_max).size(), columns_max);
  }
}

TEST(ProgressBar, IsNeverWiderThanTheLine) {
  for (std::uint64_t num_runs = 1; num_runs <= num_runs_max; num_runs *= 10) {
    for (const double rate_hz : {0.0, 1e-9, 0.05, 0.5, 20.0, 1e6}) {
      for (const std::size_t columns_max : {20U, 79U}) {
        EXPECT_LE(progress_bar(progress(num_runs - 1, num_runs, rate_hz), columns_max).size(),
                  columns_max);
      }
    }
  }
}

TEST(ProgressDisplay, WritesALineEveryTenPercent) {
  const std::string text =
      output_of<ProgressDisplay>(DisplayMode::lines, [](ProgressDisplay& display) {
        for (std::uint64_t i = 0; i <= 30; ++i) display.update(progress(i, 30, 0.0));
      });
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 11);
  EXPECT_EQ(text.substr(0, text.find('\n')), "0/30 runs    0 %");
  EXPECT_NE(text.find("\n30/30 runs  100 %\n"), std::string::npos);
}

TEST(ProgressDisplay, ShowsThatNothingCanBeStored) {
  proto::CampaignStatus failing = progress(42, 100, 0.5);
  failing.set_storage_failure("campaign database = a.db (the disk is full)");
  EXPECT_EQ(progress_bar(failing, 73),
            "42/100 runs [############..................]  42 %  nothing can be stored");
  const std::string text =
      output_of<ProgressDisplay>(DisplayMode::lines, [&](ProgressDisplay& display) {
        display.update(progress(42, 100, 0.0));
        display.update(failing);
        display.update(failing);
        display.update(progress(42, 100, 0.0));
      });
  EXPECT_EQ(text,
            "42/100 runs   42 %\n42/100 runs   42 %  nothing can be stored\n"
            "42/100 runs   42 %\n");
}

TEST(ProgressDisplay, MakesNotesVisible) {
  const std::string text = output_of<ProgressDisplay>(
      DisplayMode::lines, [](ProgressDisplay& display) { display.note("one\x1b[2J\ntwo"); });
  EXPECT_EQ(text, "one\\u001b[2J\ntwo\n");
}

TEST(ProgressDisplay, WritesTheBarOverItself) {
  const std::string text =
      output_of<ProgressDisplay>(DisplayMode::bar, [](ProgressDisplay& display) {
        display.update(progress(1, 2, 0.0));
        display.update(progress(1, 2, 0.0));  // Nothing new: not written again.
        display.update(progress(2, 2, 0.0));
      });
  EXPECT_EQ(text, "\r" + progress_bar(progress(1, 2, 0.0), 79) + "\033[K\r" +
                      progress_bar(progress(2, 2, 0.0), 79) + "\033[K\n");
}

TEST(ProgressDisplay, DoesNotTearTheBarWithANote) {
  const std::string text =
      output_of<ProgressDisplay>(DisplayMode::bar, [](ProgressDisplay& display) {
        display.update(progress(2, 2, 0.0));
        display.note("a note");
        display.update(progress(2, 2, 0.0));
      });
  const std::string bar = "\r" + progress_bar(progress(2, 2, 0.0), 79) + "\033[K";
  EXPECT_EQ(text, bar + "\r\033[Ka note\n" + bar + "\n");
}

}  // namespace
}  // namespace proofmass::coordinator
