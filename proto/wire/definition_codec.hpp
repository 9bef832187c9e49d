#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "core/campaign/definition.hpp"
#include "proto/wire/codec.hpp"
#include "proto/wire/messages.hpp"

namespace proofmass::proto {
class Definition;
class DefinitionPart;
}  // namespace proofmass::proto

namespace proofmass::wire {

/// The bytes of a definition.
/// @throws InvalidArgument if there are more than definition_size_max.
[[nodiscard]] std::string encode_definition(const Definition& definition);

/// Checks all but what the text says: sizes, counts, that rows are whole and numbers finite.
/// @param bytes  Anything at all.
/// @throws Error if they are none.
[[nodiscard]] Definition decode_definition(std::string_view bytes);

/// An encoded definition, from which parts are taken. It is made once and shared by
/// all answers.
class EncodedDefinition {
 public:
  explicit EncodedDefinition(const Definition& definition)
      : EncodedDefinition(encode_definition(definition)) {}

  /// The part that starts at the offset, or at 0 if that is beyond the end.
  [[nodiscard]] proto::DefinitionPart part(CampaignId campaign, std::uint64_t offset) const;
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

  [[nodiscard]] Progress add(const proto::DefinitionPart& part);
  /// What has arrived: the offset of the next part.
  [[nodiscard]] std::uint64_t num_bytes() const { return bytes_.size(); }
  /// The definition; all parts are dropped. @pre It is complete.
  /// @throws Error if the bytes are none.
  [[nodiscard]] Definition take();

 private:
  std::uint64_t total_size_ = 0;
  std::uint64_t checksum_ = 0;
  std::string bytes_;
};

namespace detail {

/// `message` is empty at first.
void write_definition(const Definition& definition, proto::Definition& message);

/// @pre The message has been checked.
[[nodiscard]] Definition read_definition(const proto::Definition& message);

}  // namespace detail
}  // namespace proofmass::wire
