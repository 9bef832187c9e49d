#include "coordinator/net/answers.hpp"

#include "core/error.hpp"
#include "proto/link/machine.hpp"
#include "tests/coordinator/dispatch/recording_outbox.hpp"
#include "tests/proto/link/scratch_directory.hpp"
#include "tests/proto/wire/requests.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

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

  void ask(const std::string& key, proto::Question question = proto::QUESTION_REPORT) {
    answers_.ask(test::question(question).answer(), directory_ / "a.db", {.name = key},
                 [this](proto::ReplyEnvelope reply) { replies_.push_back(std::move(reply)); });
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

  /// Of the answer to the last question that was answered.
  std::string part(const std::string& key, std::uint64_t offset = 0) {
    return part(key, offset, replies_.size() - 1);
  }
  std::string part(const std::string& key, std::uint64_t offset, std::size_t question) {
    const proto::RequestEnvelope request =
        test::answer_part(replies_.at(question).answer().answer_id(), offset);
    return answers_.part(request.answer_part(), {.name = key}).answer_part().content();
  }

  bool is_dropped(std::size_t question = 0) {
    const std::string refusal = test::message_of<Error>([&] { (void)part("anna", 0, question); });
    return refusal.ends_with("is not kept any more; ask again");
  }

  test::ScratchDirectory directory_;
  std::vector<proto::ReplyEnvelope> replies_;
  TimePoint now_{};
  ServiceConfig config_;

 private:
  State state_ = initial_state({}, {}, TimePoint{});
  StoreWriter writer_{[] {}, {}};
  Background background_{[] {}};
  test::RecordingOutbox outbox_;
  const ServiceContext context_{config_,
                                {.epoch = {1}, .host = {}, .version = {}},
                                state_,
                                writer_,
                                background_,
                                outbox_,
                                [](const Event&) {},
                                [this] { return now_; }};

 protected:
  Answers answers_{context_};
};

TEST_F(AnswersTest, AreComputedForEachKeyTwoAtATimeAndFourForAll) {
  const std::filesystem::path gate = directory_ / "gate";
  answer_with("until [ -e '" + gate.string() + "' ]; do :; done");
  ask("anna");
  ask("anna");
  EXPECT_THAT(refusal_of("anna"), StartsWith("2 questions are being answered"));
  ask("bert");
  ask("carl");
  EXPECT_THAT(refusal_of("dora"), StartsWith("4 questions are being answered"));
  std::ofstream{gate};  // Now they end.
  wait_for(4);
  for (const proto::ReplyEnvelope& reply : replies_) EXPECT_TRUE(reply.has_answer());
  ask("anna");
}

TEST_F(AnswersTest, NameTheCoordinatorsDiskIfItIsFull) {
  answer_with("echo 'proofmass: error: standard output: No space left on device' >&2; exit 1");
  ask("anna");
  wait_for(1);
  EXPECT_EQ(replies_.front().error().text(),
            "disk of the coordinator's host " + wire::host_name() +
                " = No space left on device (the answer is written there)");
}

TEST_F(AnswersTest, AreDroppedAMinuteAfterTheyWereLastRead) {
  answer_with("head -c 2000000 /dev/zero");  // The first part does not reach its end.
  ask("anna");
  wait_for(1);
  EXPECT_EQ(part("anna").size(), std::size_t{1} << 20);
  now_ += Answers::kept_for;
  answers_.review();
  EXPECT_EQ(part("anna", 3).size(), std::size_t{1} << 20);
  now_ += Answers::kept_for + std::chrono::milliseconds(1);
  answers_.review();
  EXPECT_TRUE(is_dropped());
}

// Clients that asked the same read one answer, each at its own pace.
TEST_F(AnswersTest, AreDroppedTenSecondsAfterTheyWereReadToTheirEnd) {
  ask("anna");
  wait_for(1);
  EXPECT_EQ(part("anna"), "answered\n");
  EXPECT_EQ(part("anna", 9), "");
  now_ += Answers::kept_after_end;
  answers_.review();
  EXPECT_EQ(part("anna"), "answered\n");
  now_ += Answers::kept_after_end + std::chrono::milliseconds(1);
  answers_.review();
  EXPECT_TRUE(is_dropped());
}

TEST_F(AnswersTest, MakeRoomForOthersOnceTheyWereReadToTheirEnd) {
  for (std::size_t i = 0; i < Answers::num_kept_max; ++i) {
    ask("anna");
    wait_for(i + 1);
    EXPECT_EQ(part("anna"), "answered\n");
    now_ += std::chrono::milliseconds(1);
  }
  EXPECT_EQ(part("anna", 0, 0), "answered\n");  // Now the second was read longest ago.
  now_ += std::chrono::milliseconds(1);
  ask("anna");
  EXPECT_FALSE(is_dropped(0));
  EXPECT_TRUE(is_dropped(1));
  EXPECT_FALSE(is_dropped(2));
  wait_for(Answers::num_kept_max + 1);
  EXPECT_EQ(part("anna"), "answered\n");
}

TEST_F(AnswersTest, ThatAreEmptyNeedNotBeReadToMakeRoom) {
  answer_with(":");
  for (std::size_t i = 0; i < Answers::num_kept_max + 1; ++i) {
    ask("anna");
    wait_for(i + 1);
  }
}

TEST_F(AnswersTest, AreComputedWithinLimitsThatTheProcessCannotRaise) {
  // The limits are set as soon as the process has begun; this one comes last.
  answer_with("until [ \"$(ulimit -H -t)\" = 50 ]; do :; done; ulimit -H -t; ulimit -H -c");
  config_.answer_duration_max = std::chrono::seconds(50);
  ask("anna");
  wait_for(1);
  EXPECT_EQ(part("anna"), "50\n0\n");
}

// Files that the process needs by the way, for what it sorts for example, are none of the answer.
TEST_F(AnswersTest, AreCountedWhileTheyComeAndNothingElseIs) {
  const std::string size = std::to_string(Answers::size_max + 1);
  answer_with("head -c " + size + " /dev/zero > " + (directory_ / "large").string() +
              "; echo answered");
  ask("anna");
  wait_for(1);
  EXPECT_EQ(part("anna"), "answered\n");
  answer_with("head -c " + size + " /dev/zero; sleep 3600");
  ask("anna");
  wait_for(2);
  EXPECT_EQ(replies_.back().error().text(),
            "the answer has more than 67108864 bytes; ask for less, or fetch the database");
}

// The file has no blocks: only its size says how long a copy of it is.
TEST_F(AnswersTest, DoNotCopyADatabaseForWhichTheDiskHasNoRoom) {
  const std::uintmax_t available = std::filesystem::space(directory_ / "").available;
  const std::uintmax_t size = available / 2 + (1 << 20);
  std::filesystem::resize_file(directory_ / "a.db", size);
  std::filesystem::create_directory(config_.answer_directory);
  EXPECT_THAT(test::message_of<Error>([&] { ask("anna", proto::QUESTION_DATABASE); }),
              HasSubstr("(must be " + std::to_string(2 * size) + ", twice the size of the"));
}

// Nothing is written yet of the first copy when the second is asked for.
TEST_F(AnswersTest, KeepTheRoomOfCopiesThatAreBeingMade) {
  answer_with("sleep 3600");
  const std::uintmax_t available = std::filesystem::space(directory_ / "").available;
  std::filesystem::resize_file(directory_ / "a.db", available / 3);
  std::filesystem::create_directory(config_.answer_directory);
  ask("anna", proto::QUESTION_DATABASE);
  EXPECT_THAT(test::message_of<Error>([&] { ask("ben", proto::QUESTION_DATABASE); }),
              HasSubstr("of those that are being copied; try again later)"));
}

}  // namespace
}  // namespace proofmass::coordinator
