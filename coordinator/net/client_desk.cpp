#include "coordinator/net/client_desk.hpp"

#include <fmt/format.h>

#include <variant>

#include "core/error.hpp"
#include "proto/wire/client_codec.hpp"

namespace proofmass::coordinator {
namespace {

std::string refusal(std::uint64_t request, const std::string& text) {
  return wire::encode(wire::ReplyPacket{.id = request, .reply = wire::ErrorReply{.text = text}});
}

}  // namespace

std::string answer_client(
    std::span<const std::string_view> frames,
    const std::function<wire::ClientReply(const wire::ClientRequest&)>& carry_out) {
  if (frames.size() != 1) {
    return refusal(0, fmt::format("request = {} frames (must be one)", frames.size()));
  }
  const auto decoded = wire::decode_request(frames.front());
  if (const auto* const error = std::get_if<wire::DecodeError>(&decoded)) {
    return refusal(0, error->text);
  }
  const auto& [id, request] = std::get<wire::RequestPacket>(decoded);
  try {
    return wire::encode(wire::ReplyPacket{.id = id, .reply = carry_out(request)});
  } catch (const InvalidArgument& error) {
    return refusal(id, error.what());
  }
}

}  // namespace proofmass::coordinator
