#include "coordinator/archive/campaign_mark.hpp"

#include <array>
#include <cstddef>
#include <fstream>
#include <string_view>

namespace proofmass::coordinator {

// The header of an SQLite database: its name, and at byte 68 the application_id, big-endian.
bool has_campaign_mark(const std::filesystem::path& file) {
  constexpr std::string_view format{"SQLite format 3\0", 16};
  constexpr std::string_view application = "PrMs";
  constexpr std::size_t application_at = 68;
  std::array<char, application_at + application.size()> header{};
  std::ifstream stream(file, std::ios::binary);
  if (!stream.read(header.data(), header.size())) return false;
  const std::string_view bytes(header.data(), header.size());
  return bytes.starts_with(format) && bytes.substr(application_at) == application;
}

}  // namespace proofmass::coordinator
