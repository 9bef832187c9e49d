#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <string>

#include "coordinator/page/page.hpp"

namespace proofmass::coordinator {

/// Arguments about the live page.
struct PageOptions {
  std::string address;                              ///< As it was given; empty: no page.
  std::optional<std::filesystem::path> token_file;  ///< --page-token-file.
};

/// Declares `--page` and `--page-token-file`. The flag takes an address only behind a `=`, so that
/// a file name after it is not taken for one.
void add_page_options(CLI::App& app, PageOptions& options);

/// Nothing if no page is wanted.
/// @throws UsageError `page token file = PATH (rule)`, Error as parse_page_address() and
///         PageConfig::validate() do.
[[nodiscard]] std::optional<PageConfig> page_config_of(const PageOptions& options);

}  // namespace proofmass::coordinator
