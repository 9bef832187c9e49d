#pragma once

#include <string>
#include <string_view>

#include "coordinator/cli/commands/commands.hpp"
#include "coordinator/report/status_notes.hpp"
#include "coordinator/table/terminal_table.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {

// What a coordinator replied.

/// True if it is finished or cancelled.
[[nodiscard]] bool is_over(const proto::CampaignStatus& campaign);

/// Two lines about the coordinator, a row a campaign, and lines about what is out of the ordinary.
[[nodiscard]] std::string status_text(const proto::StatusReply& status, const TerminalStyle& style);

/// A row a worker, and lines about those that are lent nothing.
[[nodiscard]] Table workers_table(const proto::WorkersReply& workers);

/// `mine active: 42 of 100 runs, 42 %, 0.500 runs/s, 1 min 56 s left`, and the notes.
[[nodiscard]] std::string campaign_line(const proto::CampaignStatus& campaign);

/// What a client asked for.
struct ActionTaken {
  std::string_view name;    ///< `pause`, `submit`.
  std::string_view kind;    ///< Of its target: `campaign`, `host`.
  std::string_view target;  ///< Name.
};

/// The coordinator's words, or an object with them: {"action": name, kind: target, "text": words}.
[[nodiscard]] std::string done_text(const proto::DoneReply& done, const ActionTaken& action,
                                    OutputFormat format);

}  // namespace proofmass::coordinator
