#include "coordinator/cli/output_file.hpp"

#include <fmt/format.h>

#include <system_error>

#include "coordinator/archive/stored_campaign.hpp"
#include "coordinator/cli/program.hpp"
#include "coordinator/cli/standard_output.hpp"
#include "core/error.hpp"
#include "proto/link/whole_file.hpp"

namespace proofmass::coordinator {

void refuse_output(const std::filesystem::path& output, std::string_view why) {
  throw UsageError(fmt::format("output = {} ({})", output.string(), why));
}

void check_output_file(const std::filesystem::path& output, wire::IfThere if_there,
                       std::string_view remedy) {
  std::error_code ignored;
  if (std::filesystem::is_symlink(output, ignored)) {
    refuse_output(output, "is a symbolic link; name the file that it leads to");
  }
  if (!std::filesystem::exists(output, ignored)) return;
  if (if_there == wire::IfThere::keep) {
    refuse_output(output, "exists already; replace it with --force");
  }
  if (!std::filesystem::is_regular_file(output)) {
    refuse_output(output, fmt::format("is no file; {}", remedy));
  }
  if (has_campaign_mark(output)) {
    refuse_output(output, "is a campaign, which --force does not replace");
  }
}

void write_output_file(const std::filesystem::path& output, wire::IfThere if_there,
                       std::string_view text) {
  wire::write_whole_file("output", output, text, wire::public_mode, if_there);
}

void check_document(const std::filesystem::path& file, wire::IfThere if_there) {
  if (file.empty() || file == "-") return;
  check_output_file(file, if_there, "- writes to standard output");
}

void write_document(const std::filesystem::path& file, wire::IfThere if_there,
                    std::string_view text) {
  if (file == "-") return write_standard_output(text);
  write_output_file(file, if_there, text);
}

void check_new_file(std::string_view argument, const std::filesystem::path& file) {
  std::error_code error;
  if (file == "-") {
    throw UsageError(fmt::format("{} = - (must be a file; ./- is one of that name)", argument));
  }
  if (std::filesystem::exists(file, error)) {
    throw UsageError(fmt::format("{} = {} (exists already)", argument, file.string()));
  }
  const bool has_directory = std::filesystem::is_directory(wire::directory_of(file), error);
  if (has_directory || error == std::errc::permission_denied) return;  // Making it says more.
  throw Error(fmt::format("{} = {} (its directory does not exist)", argument, file.string()));
}

}  // namespace proofmass::coordinator
