#include <fmt/format.h>
#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>

#include "core/error.hpp"
#include "proto/client.pb.h"
#include "proto/proofmass.pb.h"
#include "proto/wire/checks.hpp"
#include "proto/wire/client_codec.hpp"
#include "proto/wire/messages.hpp"
#include "proto/wire/rules.hpp"

namespace proofmass::wire::detail {
namespace {

// What follows from several fields. Each has obeyed its own rule before.

void require_related(const proto::Range& range) {
  require_in(range.first(), 0, num_runs_max - range.count(), "range first");
}

void require_related(const proto::Hello& hello) {
  require_in(hello.num_card_slots(), 0, hello.num_slots() - 1, "num_card_slots");
  require_in(hello.slots_per_thread(), 0, hello.num_slots() - hello.num_card_slots(),
             "slots_per_thread");
}

void require_related(const proto::Welcome& welcome) {
  const double interval_s = welcome.heartbeat_interval_s();
  require(interval_s > 0.0 && interval_s <= heartbeat_interval_s_max, "heartbeat_interval_s",
          fmt::format("{}", interval_s),
          fmt::format("must be in (0, {}]", heartbeat_interval_s_max));
}

void require_related(const proto::DefinitionPart& part) {
  require_in(part.content().size(), 1,
             std::min<std::uint64_t>(definition_part_size_max, part.total_size()), "content size");
  require_in(part.offset(), 0, part.total_size() - part.content().size(), "offset");
}

void require_related(const proto::RunLease& lease) {
  require_in(lease.first_run(), 0, num_runs_max - lease.num_runs(), "first_run");
  const auto& values = lease.table_values();
  const auto num_values = static_cast<std::uint64_t>(values.size());
  require(num_values % lease.num_runs() == 0 && num_values / lease.num_runs() <= table_columns_max,
          "table_values", fmt::format("{} entries", num_values),
          fmt::format("must be the same number for each run, at most {}", table_columns_max));
  const bool all_finite = std::ranges::all_of(values, [](double v) { return std::isfinite(v); });
  require(all_finite, "table_values", "not finite", "must be finite");
}

/// Of all lists together.
template <typename... Lists>
void require_few_ranges(const Lists&... lists) {
  std::size_t count = 0;
  const auto add = [&](const auto& list) {
    for (const auto& item : list) count += static_cast<std::size_t>(item.ranges_size());
  };
  (add(lists), ...);
  require_in(count, 0, ranges_per_message_max, "number of ranges");
}

void require_related(const proto::GiveBack& message) { require_few_ranges(message.runs()); }

void require_related(const proto::Heartbeat& heartbeat) {
  require_few_ranges(heartbeat.held(), heartbeat.set_aside());
  require_few_ranges(heartbeat.computing());
}

/// Values in range; none if they have no meaning. How many there are depends on the campaign, see
/// broken_size_rules().
void require_values(const google::protobuf::RepeatedField<double>& values, bool have_meaning,
                    double least, double most, std::string_view field) {
  require(have_meaning || values.empty(), field, fmt::format("{} entries", values.size()),
          "must be 0 with this status");
  for (const double value : values) require_in(value, least, most, field);
}

void require_loss(std::uint32_t position, bool is_lost, std::string_view field) {
  constexpr std::uint32_t positions_max = 255;
  require_in(position, is_lost ? 1 : 0, is_lost ? positions_max : 0, field);
}

void require_related(const proto::ComputedRun& run) {
  RunResult result;
  result.status = static_cast<RunStatus>(run.status());
  const bool has_truth = result.has_truth();
  const bool has_estimate = result.has_estimate();
  const bool has_errors = has_estimate && run.standard_error_size() > 0;
  const bool is_lost = result.status == RunStatus::lost;
  require_values(run.truth(), has_truth, -magnitude_max, magnitude_max, "truth");
  require_values(run.estimate(), has_estimate, -magnitude_max, magnitude_max, "estimate");
  require_values(run.standard_error(), has_estimate, -magnitude_max, magnitude_max,
                 "standard_error");
  require_values(run.health(), has_truth, 0.0, magnitude_max, "health");
  require_values(run.fit(), has_errors, 0.0, magnitude_max, "fit");
  require_values(run.correlation(), has_errors, -1.0, 1.0, "correlation");
  require_loss(run.loss_cause(), is_lost, "loss_cause");
  require_loss(run.loss_session(), is_lost, "loss_session");
  require_magnitude(run.compute_s(), "compute_s", run_time_s_max);
  require_magnitude(run.elapsed_s(), "elapsed_s", run_time_s_max);
}

void require_related(const proto::ResultAck& ack) {
  for (const std::uint64_t run : ack.runs()) require_in(run, 0, num_runs_max - 1, "run");
}

void require_related(const proto::DataTable& table) {
  const auto size = static_cast<std::uint64_t>(table.values_size());
  require(size % table.num_columns() == 0, "definition.tables.values",
          fmt::format("{} entries", size), fmt::format("must be rows of {}", table.num_columns()));
}

void require_related(const proto::RequestPart& part) {
  require_in(part.offset(), 0, part.total_size() - 1, "offset");
  require_in(part.slice().size(), 1, part.total_size() - part.offset(), "slice size");
}

void require_sha256(const std::string& text, std::string_view field) {
  const bool is_one = text.size() == 64 && text.find_first_not_of("0123456789abcdef") == text.npos;
  require(is_one, field, fmt::format("{} bytes", text.size()), "must be 64 hexadecimal digits");
}

/// It becomes an argument of a program, which ends at a zero byte.
void require_argument(const std::string& text, std::size_t size_max, std::string_view field) {
  require_in(text.size(), 1, size_max, field);
  require(text.find('\0') == text.npos, field, fmt::format("{} bytes", text.size()),
          "must not have a zero byte");
}

void require_related(const proto::AnswerRequest& request) {
  for (const std::string& option : request.options()) {
    require_argument(option, answer_option_size_max, "option size");
  }
  if (request.question() == proto::QUESTION_QUERY) {
    require_argument(request.statement(), statement_size_max, "statement size");
  }
  if (request.known_size() > 0) require_sha256(request.known_sha256(), "known_sha256");
}

void require_related(const proto::AnswerReply& reply) {
  require_in(reply.offset(), 0, reply.size(), "offset");
  require_sha256(reply.sha256(), "sha256");
}

void require_related(const proto::CampaignStatus& campaign) {
  require_in(campaign.num_given_up(), 0, campaign.num_runs(), "num_given_up");
  require_in(campaign.num_done(), 0, campaign.num_runs() - campaign.num_given_up(), "num_done");
}

using google::protobuf::Descriptor;
using google::protobuf::Message;
using Related = void (*)(const Message&);

template <typename... Messages>
std::map<const Descriptor*, Related> related_rules() {
  return {{Messages::descriptor(), [](const Message& message) {
             require_related(static_cast<const Messages&>(message));
           }}...};
}

}  // namespace

Related related_rules_of(const Descriptor& type) {
  static const auto all =
      related_rules<proto::Range, proto::Hello, proto::Welcome, proto::DefinitionPart,
                    proto::RunLease, proto::GiveBack, proto::Heartbeat, proto::ComputedRun,
                    proto::ResultAck, proto::DataTable, proto::RequestPart, proto::AnswerRequest,
                    proto::AnswerReply, proto::CampaignStatus>();
  const auto found = all.find(&type);
  return found == all.end() ? nullptr : found->second;
}

}  // namespace proofmass::wire::detail
