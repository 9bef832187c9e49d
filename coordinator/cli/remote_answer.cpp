#include "coordinator/cli/remote_answer.hpp"

#include <fmt/format.h>

#include "coordinator/cli/standard_output.hpp"
#include "coordinator/net/answers.hpp"
#include "coordinator/store/sha256.hpp"
#include "core/error.hpp"
#include "proto/command_line/standard_error.hpp"
#include "proto/text/visible_text.hpp"

namespace proofmass::coordinator {

void add_optional_connection(CLI::App& command, ClientConnectionConfig& connection) {
  command.add_option("--connect", connection.endpoint,
                     "Ask the coordinator with this address for\nclients; DB is a campaign's name");
  add_key_options(command, connection);
}

proto::RequestEnvelope question_about(const std::string& campaign, proto::Question question) {
  proto::RequestEnvelope request;
  request.mutable_answer()->set_campaign(checked_campaign_name(campaign));
  request.mutable_answer()->set_question(question);
  return request;
}

void read_answer(const Ask& ask, const proto::AnswerReply& answer,
                 const std::function<void(std::string_view)>& take) {
  proto::RequestEnvelope request;
  proto::AnswerPartRequest& wanted = *request.mutable_answer_part();
  wanted.set_answer_id(answer.answer_id());
  wanted.set_offset(answer.offset());
  while (wanted.offset() < answer.size()) {
    const proto::ReplyEnvelope reply = reply_of(ask, request, proto::ReplyEnvelope::kAnswerPart);
    const std::string& content = reply.answer_part().content();
    if (content.empty()) return;
    take(content);
    wanted.set_offset(wanted.offset() + content.size());
  }
  if (wanted.offset() > answer.size())
    throw Error("the answer became shorter while it was read; ask again");
}

int print_answer(const ClientConnectionConfig& connection, const proto::RequestEnvelope& question,
                 AnswerText text) {
  return with_connection({.connection = connection}, [&](const Ask& ask) {
    const proto::ReplyEnvelope reply = reply_of(ask, question, proto::ReplyEnvelope::kAnswer);
    const proto::AnswerReply& answer = reply.answer();
    if (answer.size() > Answers::size_max) {  // It would have to be held in memory.
      throw Error(
          fmt::format("answer = {} bytes (must be at most {})", answer.size(), Answers::size_max));
    }
    std::string bytes;
    read_answer(ask, answer, [&](std::string_view part) { bytes += part; });
    Sha256 hash;
    hash.add_bytes(bytes);
    if (hash.finish() != answer.sha256())
      throw Error("the answer is not the one that was announced; ask again");
    if (text == AnswerText::lines) print_lines(bytes);
    if (text == AnswerText::bytes) write_standard_output(bytes);
    flush_standard_output();
    if (!answer.error_text().empty()) wire::say(wire::visible_lines(answer.error_text()));
    return static_cast<int>(answer.exit_code());
  });
}

}  // namespace proofmass::coordinator
