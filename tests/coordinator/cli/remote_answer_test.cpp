// Questions about results that a coordinator answers. A script takes the place of the program that
// it asks: what that program answers is tested in tests/system/remote_results_test.cpp.

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "coordinator/cli/client.hpp"
#include "coordinator/net/answers.hpp"
#include "proto/wire/client_codec.hpp"
#include "tests/coordinator/cli/program.hpp"
#include "tests/coordinator/net/playing_client.hpp"
#include "tests/coordinator/net/service_fixture.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using proto::AnswerReply;
using test::question;

// Of "hello\n", by sha256sum.
constexpr const char* sha256_of_hello =
    "5891b5b522d5df086d0ff0b110fbd9d21bb4fc7163af34d08286a2e846f6be03";

class Answering : public test::ServiceTest {
 protected:
  Answering() {
    config.clients_endpoint = "tcp://127.0.0.1:*";
    config.answer_program = directory / "program";
    config.answer_directory = directory / "answers";
  }

  /// A coordinator with a campaign `a` that asks this program.
  void start_with(const std::string& script) {
    std::ofstream(config.answer_program) << "#!/bin/sh\n" << script << "\n";
    chmod(config.answer_program.c_str(), 0700);
    start({test::campaign_of("a", 5)});
    client.emplace(service->clients_endpoint());
  }

  [[nodiscard]] AnswerReply answer_to(const proto::RequestEnvelope& request) {
    const proto::ReplyEnvelope reply = client->ask(request);
    EXPECT_TRUE(reply.has_answer()) << reply.error().text();
    return reply.answer();
  }
  [[nodiscard]] std::string part(const AnswerReply& answer, std::uint64_t offset) {
    return client->ask(test::answer_part(answer.answer_id(), offset)).answer_part().content();
  }

  std::optional<test::PlayingClient> client;
};

TEST_F(Answering, HasNoSettingsOfTheCoordinator) {
  setenv("PROOFMASS_CONFIG", "/somewhere", 1);
  start_with("env");
  unsetenv("PROOFMASS_CONFIG");
  const std::string environment = part(answer_to(question()), 0);
  EXPECT_THAT(environment, HasSubstr("PATH="));
  EXPECT_THAT(environment, Not(HasSubstr("PROOFMASS")));
}

TEST_F(Answering, RefusesOptionsThatReadOrWriteOtherFiles) {
  start_with("echo never");
  const auto error_of = [&](proto::Question kind, const std::string& option) {
    return client->error(question(kind, {option}, kind == proto::QUESTION_QUERY ? "x" : ""));
  };
  EXPECT_EQ(error_of(proto::QUESTION_QUERY, "--attach=b=/etc/shadow"),
            "option = --attach (must be one of those of query that a coordinator knows: --format "
            "--timeout --rows-max --columns)");
  EXPECT_THAT(error_of(proto::QUESTION_QUERY, "--json"), StartsWith("option = --json (must be"));
  EXPECT_THAT(error_of(proto::QUESTION_REPORT, "--html=/tmp/x"),
              StartsWith("option = --html (must be"));
  EXPECT_THAT(error_of(proto::QUESTION_REPORT, "/etc/shadow"),
              StartsWith("option = /etc/shadow (must"));
  EXPECT_THAT(error_of(proto::QUESTION_REPORT, "--jso"), StartsWith("option = --jso (must be"));
  EXPECT_THAT(error_of(proto::QUESTION_DATABASE, "--json"), StartsWith("option = --json (must be"));
}

// The coordinator still has the campaign's own file open, which has lost its name.
TEST_F(Answering, IsNotThatOfACampaignWhoseFileTookTheName) {
  start_with("echo never");
  (void)files.open(test::campaign_of("b", 5), {}, {});
  std::filesystem::rename(directory / "b.db", directory / "a.db");
  for (const proto::Question kind : {proto::QUESTION_REPORT, proto::QUESTION_DATABASE}) {
    EXPECT_EQ(
        client->error(question(kind)),
        "campaign database = a.db (took the place of the file that is being served, and is of "
        "another campaign; move it away)");
  }
}

TEST_F(Answering, IsRefusedWhereThereIsNoProgram) {
  config.answer_program.clear();
  start({test::campaign_of("a", 5)});
  client.emplace(service->clients_endpoint());
  EXPECT_EQ(
      client->error(question()),
      "this coordinator cannot answer questions about results, as the program proofmass is not "
      "beside proofmass-coordinator; install it there");
}

TEST_F(Answering, SaysWhyAProgramCannotBeStarted) {
  start_with("echo never");
  std::filesystem::remove(config.answer_program);
  EXPECT_THAT(client->error(question()),
              HasSubstr("program: cannot be started: No such file or directory"));
}

TEST_F(Answering, SaysThatItsOutputHasNoPlace) {
  config.answer_directory = directory / "missing" / "answers";
  start_with("echo never");
  EXPECT_THAT(client->error(question()), HasSubstr("answers: No such file or directory"));
}

TEST_F(Answering, EndsAProgramThatTakesTooLong) {
  config.answer_duration_max = std::chrono::milliseconds(300);
  start_with("exec sleep 1000");
  EXPECT_EQ(client->error(question()), "there was no answer within 0.3 s; ask for less");
}

TEST_F(Answering, SaysThatAProgramCrashed) {
  start_with("kill -TERM $$");
  EXPECT_EQ(client->error(question()), "answer: the process was killed by signal 15 (Terminated)");
}

// Others do not wait for one that takes long, and which the end of the service ends.
TEST_F(Answering, LeavesTheServiceToOthers) {
  start_with("exec sleep 1000");
  client->send(1, question());
  test::PlayingClient other(service->clients_endpoint());
  EXPECT_EQ(other.status().campaigns(0).name(), "a");
}

TEST_F(Answering, KeepsNoMoreAnswersThanItMay) {
  start_with("echo $2");
  for (std::size_t i = 0; i < Answers::num_kept_max; ++i) {
    EXPECT_EQ(answer_to(question(proto::QUESTION_REPORT, {"--json"})).size(), 7U) << i;
  }
  EXPECT_THAT(client->error(question()), StartsWith("16 questions are being answered"));
}

// Their requests have the same bytes, so one process answers both. A client's requests are taken in
// order: once it has the status, its question was taken.
TEST_F(Answering, GivesOneAnswerToAllWhoAskTheSameAtTheSameTime) {
  const std::filesystem::path gate = directory / "gate";
  start_with("until [ -e '" + gate.string() + "' ]; do :; done; echo hello");
  test::PlayingClient other(service->clients_endpoint());
  for (test::PlayingClient* const asking : {&*client, &other}) {
    asking->send(100, question());
    (void)asking->status();
  }
  std::ofstream{gate};
  const std::uint64_t answer_id = client->receive_final().answer().answer_id();
  EXPECT_NE(answer_id, 0U);
  EXPECT_EQ(other.receive_final().answer().answer_id(), answer_id);
  for (test::PlayingClient* const reading : {&*client, &other}) {
    for (const auto& [offset, content] : {std::pair(0U, "hello\n"), std::pair(6U, "")}) {
      const proto::ReplyEnvelope reply = reading->ask(test::answer_part(answer_id, offset));
      EXPECT_TRUE(reply.has_answer_part());
      EXPECT_EQ(reply.answer_part().content(), content);
    }
  }
}

// The script copies the file that it is to back up.
TEST_F(Answering, SendsOfADatabaseOnlyWhatTheClientLacks) {
  start_with("[ \"$1 $2\" = 'backup --' ] && printf 'hello\\nworld' >\"$4\"");
  const proto::RequestEnvelope all = question(proto::QUESTION_DATABASE);
  EXPECT_EQ(answer_to(all).offset(), 0U);
  proto::RequestEnvelope rest = all;
  rest.mutable_answer()->set_known_size(6);
  rest.mutable_answer()->set_known_sha256(sha256_of_hello);
  const AnswerReply answer = answer_to(rest);
  EXPECT_EQ(answer.offset(), 6U);
  EXPECT_EQ(part(answer, 6), "world");
  for (const std::uint64_t other_size : {5U, 7U, 1000U}) {
    proto::RequestEnvelope other = rest;
    other.mutable_answer()->set_known_size(other_size);
    EXPECT_EQ(answer_to(other).offset(), 0U) << other_size;
  }
  EXPECT_TRUE(std::filesystem::is_empty(config.answer_directory));
}

// Whatever a second process wrote would be in the database that the first one completes.
TEST_F(Answering, IsFetchedByOneProcessAtATime) {
  start_with("[ \"$1 $2\" = 'backup --' ] && printf 'hello\\n' >\"$4\"");
  const std::filesystem::path copy = directory / "copy.db";
  const std::string part = copy.string() + ".part";
  const int first = open(part.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  ASSERT_EQ(flock(first, LOCK_EX), 0);
  const auto answer =
      test::answer_of({"fetch", "a", copy, "--connect", service->clients_endpoint()});
  close(first);
  EXPECT_EQ(answer.exit_code, exit_cannot_be_done);
  EXPECT_EQ(answer.error,
            "file = " + part + " (is being written by another `fetch`; try again later)");
  EXPECT_EQ(std::filesystem::file_size(part), 0U);
  EXPECT_FALSE(std::filesystem::exists(copy));
}

TEST_F(Answering, GivesAnAnswerToTheKeyThatAskedOnly) {
  ASSERT_EQ(test::answer_of({"keygen", directory / "keys"}).exit_code, exit_done);
  ASSERT_EQ(test::answer_of({"keygen", directory / "keys", "--client", "eve"}).exit_code,
            exit_done);
  std::filesystem::create_directory(directory / "eve");
  std::filesystem::rename(directory / "keys" / "eve.key", directory / "eve" / "client.key");
  std::filesystem::copy(directory / "keys" / "coordinator.pub", directory / "eve");
  config.keys = directory / "keys";
  std::ofstream(config.answer_program) << "#!/bin/sh\necho hello\n";
  chmod(config.answer_program.c_str(), 0700);
  start({test::campaign_of("a", 5)});
  ClientConnection owner({.endpoint = service->clients_endpoint(), .keys = directory / "keys"});
  ClientConnection other({.endpoint = service->clients_endpoint(), .keys = directory / "eve"});
  const proto::RequestEnvelope request =
      test::answer_part(owner.ask(question()).answer().answer_id());
  EXPECT_THAT(other.ask(request).error().text(), HasSubstr("is not kept any more"));
  EXPECT_EQ(owner.ask(request).answer_part().content(), "hello\n");
}

/// A coordinator of which a test makes up the replies.
class MadeUpAnswer : public testing::Test {
 protected:
  /// What read_answer() takes of these parts.
  [[nodiscard]] std::string read(std::vector<std::string> parts, std::uint64_t size) {
    std::string taken;
    std::size_t next = 0;
    const Ask ask = [&](const proto::RequestEnvelope& request) {
      EXPECT_EQ(request.answer_part().offset(), taken.size());
      ++num_asked_;
      proto::ReplyEnvelope reply;
      reply.mutable_answer_part()->set_content(next < parts.size() ? parts[next++] : "");
      return reply;
    };
    AnswerReply answer;
    answer.set_answer_id(1);
    answer.set_size(size);
    read_answer(ask, answer, [&](std::string_view text) { taken += text; });
    return taken;
  }

  int num_asked_ = 0;  ///< Parts.
};

TEST_F(MadeUpAnswer, IsReadToItsEnd) { EXPECT_EQ(read({"ab", "c", "def"}, 6), "abcdef"); }

// The coordinator may end, or drop the answer, as soon as all of it has been sent.
TEST_F(MadeUpAnswer, IsAskedForNothingBeyondItsSize) {
  EXPECT_EQ(read({"ab", "c"}, 3), "abc");
  EXPECT_EQ(num_asked_, 2);
  EXPECT_EQ(read({}, 0), "");
  EXPECT_EQ(num_asked_, 2);
}

TEST_F(MadeUpAnswer, IsNoLongerThanItsSize) {
  EXPECT_EQ(test::message_of<Error>([&] { (void)read(std::vector<std::string>(100, "ab"), 5); }),
            "the answer became shorter while it was read; ask again");
}

}  // namespace
}  // namespace proofmass::coordinator
