#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "core/environment/environment_table.hpp"

namespace proofmass::coordinator::detail {

/// A file cannot be opened, is no regular file, or is too large; the text is the reason alone.
class UnreadableFile : public Error {
 public:
  using Error::Error;
};

/// All bytes of a file.
/// @throws UnreadableFile
[[nodiscard]] std::string read_text_file(const std::filesystem::path& file,
                                         std::uintmax_t size_max);

/// Rows of an environment file, checked for an orbit of that period.
///
/// @param name  For messages: path of the file that has the text.
/// @throws DefinitionError naming file, line and reason.
[[nodiscard]] EnvironmentTable parse_environment(std::string_view text, const std::string& name,
                                                 double orbit_period_s);

/// One column, by its heading, of comma-separated text whose first line holds the headings.
/// @throws DefinitionError naming file, line and reason.
[[nodiscard]] std::vector<double> parse_column(std::string_view text, const std::string& name,
                                               std::string_view heading);

}  // namespace proofmass::coordinator::detail
