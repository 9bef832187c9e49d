#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>

#include "core/campaign/campaign.hpp"
#include "proto/wire/definition_codec.hpp"
#include "proto/wire/messages.hpp"

namespace proofmass::coordinator {

/// Encoded definitions of the campaigns that workers asked for last: each is encoded once for all
/// of them, and again after the campaign was extended.
class DefinitionCache {
 public:
  /// Bytes that are kept: with the newest one at most this and definition_size_max.
  static constexpr std::size_t default_size_max = wire::definition_size_max;

  explicit DefinitionCache(std::size_t size_max = default_size_max) : size_max_(size_max) {}

  /// The answer to a request. @pre The definition was accepted as a submission: it is not too
  /// large.
  [[nodiscard]] wire::DefinitionPart part(const wire::CampaignRequest& request,
                                          const std::shared_ptr<const Campaign>& definition);

  [[nodiscard]] std::uint64_t num_encoded() const { return num_encoded_; }  ///< So far.
  [[nodiscard]] std::size_t size() const { return size_; }                  ///< Bytes kept.

 private:
  struct Entry {
    std::shared_ptr<const Campaign> definition;  ///< Shared with the dispatch: the one encoded.
    wire::EncodedDefinition encoded;
    std::uint64_t used = 0;  ///< Grows with each use: the smallest is the longest ago.
  };

  void make_room();

  std::size_t size_max_;
  std::size_t size_ = 0;
  std::uint64_t num_uses_ = 0;
  std::uint64_t num_encoded_ = 0;
  std::map<wire::CampaignId, Entry> entries_;
};

}  // namespace proofmass::coordinator
