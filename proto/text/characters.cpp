#include "proto/text/characters.hpp"

#include <utf8.h>

namespace proofmass::wire {

Character first_character(std::string_view text) {
  try {
    const char* at = text.data();
    const char32_t code = utf8::next(at, text.data() + text.size());
    return {.code = code, .size = static_cast<std::size_t>(at - text.data()), .is_valid = true};
  } catch (const utf8::exception&) {
    return {};
  }
}

}  // namespace proofmass::wire
