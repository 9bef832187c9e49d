#include "proto/command_line/standard_error.hpp"

#include <exception>

#include "proto/text/visible_text.hpp"

namespace proofmass::wire {

void say(std::string_view text) noexcept {
  try {
    say_on(stderr, visible_lines(text));
  } catch (const std::exception&) {
    // Without memory nothing can be made visible.
  }
}

void say_on(std::FILE* stream, std::string_view text) noexcept {
  (void)std::fwrite(text.data(), 1, text.size(), stream);
}

}  // namespace proofmass::wire
