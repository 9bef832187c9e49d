#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "core/campaign/campaign.hpp"
#include "proto/wire/codec.hpp"
#include "proto/wire/messages.hpp"

namespace proofmass::wire {

/// The bytes of a campaign's definition, without the values of its tables, which come with each
/// lease.
/// @throws InvalidArgument if there are more than definition_size_max.
[[nodiscard]] std::string encode_definition(const Campaign& campaign);

/// Checks everything, as decode() does.
/// @param bytes  Anything at all.
[[nodiscard]] std::variant<std::shared_ptr<const Campaign>, DecodeError> decode_definition(
    std::string_view bytes);

/// The encoded definition of a campaign, from which parts are taken. It is made once and shared by
/// all answers.
class EncodedDefinition {
 public:
  explicit EncodedDefinition(const Campaign& campaign)
      : EncodedDefinition(encode_definition(campaign)) {}

  /// The part that starts at the offset of the request, or at 0 if that is beyond the end.
  [[nodiscard]] DefinitionPart part(const CampaignRequest& request) const;
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }

 private:
  explicit EncodedDefinition(std::string bytes);

  std::string bytes_;
  std::uint64_t checksum_;
};

/// A definition that arrives in parts. Parts of another version of it, as after an extension, start
/// it anew.
class IncomingDefinition {
 public:
  /// What a part leads to.
  enum class Progress : std::uint8_t {
    ignored,   ///< It was here already.
    advanced,  ///< The next part is to be asked for, from num_bytes() on.
    complete,  ///< take() returns the definition.
  };

  [[nodiscard]] Progress add(const DefinitionPart& part);
  /// What has arrived: the offset of the next part.
  [[nodiscard]] std::uint64_t num_bytes() const { return bytes_.size(); }
  /// The definition, or why the bytes are none; all parts are dropped. @pre It is complete.
  [[nodiscard]] std::variant<std::shared_ptr<const Campaign>, DecodeError> take();

 private:
  std::uint64_t total_size_ = 0;
  std::uint64_t checksum_ = 0;
  std::string bytes_;
};

}  // namespace proofmass::wire
