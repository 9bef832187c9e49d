#include "coordinator/cli/page_options.hpp"

#include <fmt/format.h>

#include "coordinator/cli/program.hpp"
#include "proto/command_line/option_checks.hpp"

namespace proofmass::coordinator {

void add_page_options(CLI::App& app, PageOptions& options) {
  app.add_flag("--page", options.address,
               "Serve the live page, at 127.0.0.1:5557 or at\n--page=HOST:PORT")
      ->envname("PROOFMASS_PAGE");
  app.add_option("--page-token-file", options.token_file,
                 "File with a secret that visitors of the page\nmust show; needed beyond loopback")
      ->type_name(wire::file_type)
      ->envname("PROOFMASS_PAGE_TOKEN_FILE");
}

std::optional<PageConfig> page_config_of(const PageOptions& options) {
  // Without an address the library writes the word of a flag that is set.
  const bool is_off = options.address.empty() || options.address == "false";
  const bool is_default = options.address == "true";
  if (!is_off) {
    PageConfig config{.address = parse_page_address(is_default ? page_address_by_default
                                                               : std::string_view(options.address)),
                      .token_file = options.token_file};
    config.validate();
    return config;
  }
  if (options.token_file) {
    throw UsageError(
        fmt::format("page token file = {} (must be with --page)", options.token_file->string()));
  }
  return std::nullopt;
}

}  // namespace proofmass::coordinator
