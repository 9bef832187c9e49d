#include "coordinator/cli/init_command.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <fstream>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/cli/exit_code.hpp"
#include "core/campaign/model.hpp"

namespace proofmass::coordinator {

int write_campaign(const std::filesystem::path& file, IfFileExists if_exists) {
  if (if_exists == IfFileExists::refuse && std::filesystem::exists(file)) {
    throw UsageError(fmt::format("{} exists (replace it with --force)", file.string()));
  }
  std::ofstream stream(file, std::ios::binary | std::ios::trunc);
  stream << model().example();
  stream.close();
  if (!stream) throw Error(fmt::format("{}: {}", file.string(), std::strerror(errno)));
  fmt::print("wrote {}\n", file.string());
  return exit_done;
}

}  // namespace proofmass::coordinator
