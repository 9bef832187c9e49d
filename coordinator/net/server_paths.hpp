#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {

/// Where a coordinator keeps its files, which concerns nobody on another machine: what is said to
/// clients and on the page names files as they are called within the directory of campaigns. The
/// log has whole paths.
class ServerPaths {
 public:
  /// @param directory  Of campaigns; may be empty.
  explicit ServerPaths(const std::filesystem::path& directory);

  /// The text with files of the directory named within it: `campaign database = a.db (is no file)`.
  /// Other paths stay: they are those that a client sent.
  [[nodiscard]] std::string hidden_in(std::string_view text) const;
  /// Hides paths in all that the reply says of files and failures; an error of a full disk says
  /// whose disk that is instead. To be called before it is
  /// encoded, since that may change or cut a path.
  void hide_in(proto::ReplyEnvelope& reply) const;
  void hide_in(proto::StatusReply& reply) const;
  void hide_in(proto::CampaignStatus& campaign) const;

 private:
  std::vector<std::string> prefixes_;  ///< Spellings of the directory, with a slash at the end.
};

}  // namespace proofmass::coordinator
