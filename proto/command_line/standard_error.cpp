#include "proto/command_line/standard_error.hpp"

namespace proofmass::wire {

void say(std::string_view text) noexcept { say_on(stderr, text); }

void say_on(std::FILE* stream, std::string_view text) noexcept {
  (void)std::fwrite(text.data(), 1, text.size(), stream);
}

}  // namespace proofmass::wire
