#include "coordinator/net/answers.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "core/error.hpp"
#include "tests/coordinator/cli/temporary_directory.hpp"
#include "tests/coordinator/dispatch/recording_outbox.hpp"
#include "tests/message_of.hpp"

namespace proofmass::coordinator {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

/// Questions that a shell script answers in place of `proofmass`, at times that the test chooses.
class AnswersTest : public testing::Test {
 protected:
  AnswersTest() {
    config_.answer_program = directory_ / "proofmass";
    config_.answer_directory = directory_ / "answers";
    std::ofstream(directory_ / "a.db") << "a database";
    answer_with("echo answered");
  }

  void answer_with(const std::string& script) const {
    std::ofstream(config_.answer_program) << "#!/bin/sh\n" << script << "\n";
    std::filesystem::permissions(config_.answer_program, std::filesystem::perms::owner_all);
  }

  void ask(const std::string& key, wire::Question question = wire::Question::report) {
    answers_.ask({.campaign = "a", .question = question}, directory_ / "a.db", {.name = key},
                 [this](wire::ClientReply reply) { replies_.push_back(std::move(reply)); });
  }

  std::string refusal_of(const std::string& key) {
    return test::message_of<Error>([&] { ask(key); });
  }

  /// Reviews until so many questions are answered.
  void wait_for(std::size_t num_replies) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (replies_.size() < num_replies && std::chrono::steady_clock::now() < deadline) {
      answers_.review();
      std::this_thread::yield();
    }
    ASSERT_EQ(replies_.size(), num_replies);
  }

  /// @pre The last question was answered.
  std::string part(const std::string& key, std::uint64_t offset = 0) {
    const auto& answer = std::get<wire::AnswerReply>(replies_.back());
    return answers_.part({.answer_id = answer.answer_id, .offset = offset}, {.name = key}).content;
  }

  test::TemporaryDirectory directory_;
  std::vector<wire::ClientReply> replies_;
  TimePoint now_{};
  ServiceConfig config_;

 private:
  State state_ = initial_state({}, {}, TimePoint{});
  StoreWriter writer_{[] {}, {}};
  Background background_{[] {}};
  test::RecordingOutbox outbox_;
  const ServiceContext context_{
      config_, {}, state_, writer_, background_, outbox_, [this] { return now_; }};

 protected:
  Answers answers_{context_};
};

TEST_F(AnswersTest, AreComputedForEachKeyTwoAtATimeAndFourForAll) {
  const std::filesystem::path gate = directory_ / "gate";
  answer_with("until [ -e '" + gate.string() + "' ]; do :; done");
  ask("anna");
  ask("anna");
  EXPECT_THAT(refusal_of("anna"), StartsWith("questions = 2 (are being answered"));
  ask("bert");
  ask("carl");
  EXPECT_THAT(refusal_of("dora"), StartsWith("questions = 4 (are being answered"));
  std::ofstream{gate};  // Now they end.
  wait_for(4);
  for (const wire::ClientReply& reply : replies_) {
    EXPECT_TRUE(std::holds_alternative<wire::AnswerReply>(reply));
  }
  ask("anna");
}

TEST_F(AnswersTest, AreDroppedAMinuteAfterTheyWereLastRead) {
  ask("anna");
  wait_for(1);
  EXPECT_EQ(part("anna"), "answered\n");
  now_ += Answers::kept_for;
  answers_.review();
  EXPECT_EQ(part("anna", 3), "wered\n");
  now_ += Answers::kept_for + std::chrono::milliseconds(1);
  answers_.review();
  EXPECT_THAT(test::message_of<Error>([&] { (void)part("anna"); }), HasSubstr("is not kept"));
}

TEST_F(AnswersTest, AreComputedWithinLimitsThatTheProcessCannotRaise) {
  // The limits are set as soon as the process has begun.
  answer_with(
      "until [ \"$(ulimit -H -f)\" != unlimited ]; do :; done\n"
      "ulimit -H -t; ulimit -H -c; ulimit -H -f");
  config_.answer_duration_max = std::chrono::seconds(50);
  ask("anna");
  wait_for(1);
  constexpr std::uint64_t block_size = 512;  // In which a shell counts.
  EXPECT_EQ(part("anna"), "50\n0\n" + std::to_string(Answers::size_max / block_size) + "\n");
}

// The file has no blocks: only its size says how long a copy of it is.
TEST_F(AnswersTest, DoNotCopyADatabaseForWhichTheDiskHasNoRoom) {
  const std::uintmax_t available = std::filesystem::space(directory_ / "").available;
  const std::uintmax_t size = available / 2 + (1 << 20);
  std::filesystem::resize_file(directory_ / "a.db", size);
  std::filesystem::create_directory(config_.answer_directory);
  EXPECT_THAT(test::message_of<Error>([&] { ask("anna", wire::Question::database); }),
              HasSubstr("(must be " + std::to_string(2 * size) + ", twice the size of the"));
}

}  // namespace
}  // namespace proofmass::coordinator
