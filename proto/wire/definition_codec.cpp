#include "proto/wire/definition_codec.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "core/error.hpp"
#include "core/math/hash.hpp"
#include "proto/proofmass.pb.h"
#include "proto/wire/checks.hpp"
#include "proto/wire/definition_message.hpp"

namespace proofmass::wire {
namespace {

/// Tables and columns have at most some thousands; an array of numbers is one.
constexpr std::size_t fields_max = 4096;

std::string size_text(std::size_t size) {
  return fmt::format("definition size = {} bytes (must be at most {})", size, definition_size_max);
}

}  // namespace

std::string encode_definition(const Definition& definition) {
  proto::Definition message;
  detail::write_definition(definition, message);
  const std::size_t size = message.ByteSizeLong();
  if (size > definition_size_max) throw InvalidArgument(size_text(size));
  return message.SerializeAsString();
}

std::variant<Definition, DecodeError> decode_definition(std::string_view bytes) {
  detail::silence_protobuf();
  if (bytes.size() > definition_size_max) {
    return DecodeError{DecodeFault::too_large, size_text(bytes.size())};
  }
  proto::Definition message;
  const bool is_parsed =
      detail::has_fields_at_most(bytes, *proto::Definition::descriptor(), fields_max) &&
      message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
  if (!is_parsed) {
    return DecodeError{
        DecodeFault::unparsable,
        fmt::format("definition = {} bytes (must be a definition of at most {} fields)",
                    bytes.size(), fields_max)};
  }
  try {
    return detail::read_definition(message);
  } catch (const Error& error) {
    return DecodeError{DecodeFault::invalid, detail::printable(error.what())};
  }
}

EncodedDefinition::EncodedDefinition(std::string bytes)
    : bytes_(std::move(bytes)), checksum_(fnv1a(bytes_)) {}

DefinitionPart EncodedDefinition::part(const CampaignRequest& request) const {
  const std::uint64_t offset = request.offset < bytes_.size() ? request.offset : 0;
  return {.campaign = request.campaign,
          .offset = offset,
          .total_size = bytes_.size(),
          .checksum = checksum_,
          .content = bytes_.substr(offset, definition_part_size_max)};
}

IncomingDefinition::Progress IncomingDefinition::add(const DefinitionPart& part) {
  if (part.total_size != total_size_ || part.checksum != checksum_) {
    total_size_ = part.total_size;
    checksum_ = part.checksum;
    bytes_.clear();
    if (part.offset > 0) return Progress::advanced;
  }
  if (part.offset != bytes_.size()) return Progress::ignored;
  bytes_ += part.content;
  return bytes_.size() == total_size_ ? Progress::complete : Progress::advanced;
}

std::variant<Definition, DecodeError> IncomingDefinition::take() {
  PROOFMASS_EXPECT(bytes_.size() == total_size_);
  const std::string bytes = std::exchange(bytes_, {});
  total_size_ = 0;
  const std::uint64_t expected = std::exchange(checksum_, 0);
  const std::uint64_t found = fnv1a(bytes);
  if (found != expected) {
    return DecodeError{
        DecodeFault::invalid,
        fmt::format("checksum = {:016x} (must be {:016x}, the definition's)", found, expected)};
  }
  return decode_definition(bytes);
}

}  // namespace proofmass::wire
