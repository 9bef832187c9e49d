#include "coordinator/cli/output_file.hpp"

#include <fmt/format.h>

#include <system_error>

#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/cli/program.hpp"

namespace proofmass::coordinator {

void refuse_output(const std::filesystem::path& output, std::string_view why) {
  throw UsageError(fmt::format("output = {} ({})", output.string(), why));
}

void check_output_file(const std::filesystem::path& output, IfThere if_there,
                       std::string_view remedy) {
  std::error_code ignored;
  if (!std::filesystem::exists(output, ignored)) return;
  if (if_there == IfThere::keep) {
    refuse_output(output, "exists already; replace it with --force");
  }
  if (!std::filesystem::is_regular_file(output)) {
    refuse_output(output, fmt::format("is no file; {}", remedy));
  }
  if (has_campaign_mark(output)) {
    refuse_output(output, "is a campaign, which --force does not replace");
  }
}

}  // namespace proofmass::coordinator
