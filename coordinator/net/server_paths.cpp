#include "coordinator/net/server_paths.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <system_error>

#include "coordinator/store/records.hpp"
#include "proto/link/machine.hpp"

namespace proofmass::coordinator {
namespace {

constexpr std::string_view before_a_path = " \t\n\"'`(=[,;";

bool may_begin_path(std::string_view text, std::size_t position) {
  return position == 0 || before_a_path.find(text[position - 1]) != std::string_view::npos;
}

/// A client has a disk of its own, and did not name the file that the coordinator could not write.
void name_full_disk(std::string& failure) {
  if (failure.find(fmt::format("({};", disk_full_text)) == std::string::npos) return;
  failure = fmt::format(
      "disk of the coordinator's host {} = full (what was stored before is safe; free space there "
      "and try again)",
      wire::host_name());
}

}  // namespace

ServerPaths::ServerPaths(const std::filesystem::path& directory) {
  if (directory.empty()) return;
  std::error_code ignored;
  for (const std::filesystem::path& spelling :
       {directory, std::filesystem::absolute(directory, ignored),
        std::filesystem::weakly_canonical(directory, ignored)}) {
    if (!spelling.empty()) prefixes_.push_back((spelling / "").string());
  }
  std::ranges::sort(prefixes_, std::ranges::greater(), &std::string::size);
}

std::string ServerPaths::hidden_in(std::string_view text) const {
  std::string result;
  for (std::size_t i = 0; i < text.size();) {
    const std::string_view rest = text.substr(i);
    const auto within = std::ranges::find_if(
        prefixes_, [&](const std::string& prefix) { return rest.starts_with(prefix); });
    if (may_begin_path(text, i) && within != prefixes_.end()) {
      i += within->size();
    } else {
      result += text[i++];
    }
  }
  return result;
}

void ServerPaths::hide_in(proto::CampaignStatus& campaign) const {
  campaign.set_storage_failure(hidden_in(campaign.storage_failure()));
}

void ServerPaths::hide_in(proto::StatusReply& reply) const {
  for (proto::CampaignStatus& campaign : *reply.mutable_campaigns()) hide_in(campaign);
  for (proto::UnservedFile& unserved : *reply.mutable_unserved_files()) {
    unserved.set_file(hidden_in(unserved.file()));
    unserved.set_reason(hidden_in(unserved.reason()));
  }
}

void ServerPaths::hide_in(proto::ReplyEnvelope& reply) const {
  const auto hide = [&](std::string* text) { *text = hidden_in(*text); };
  if (reply.has_status()) hide_in(*reply.mutable_status());
  if (reply.has_done()) hide(reply.mutable_done()->mutable_text());
  if (reply.has_error()) {
    hide(reply.mutable_error()->mutable_text());
    name_full_disk(*reply.mutable_error()->mutable_text());
  }
  if (reply.has_answer()) hide(reply.mutable_answer()->mutable_error_text());
}

}  // namespace proofmass::coordinator
