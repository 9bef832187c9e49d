#include "coordinator/archive/stored_campaign.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <fstream>
#include <string_view>
#include <system_error>

#include "coordinator/campaign_file/campaign_file.hpp"
#include "coordinator/report/digest.hpp"
#include "core/model.hpp"

namespace proofmass::coordinator {
namespace {

// To open a pipe would wait for somebody to write to it.
bool is_file(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(path, ignored);
}

}  // namespace

// The header of an SQLite database: its name, and at byte 68 the application_id, big-endian.
bool has_campaign_mark(const std::filesystem::path& file) {
  constexpr std::string_view format{"SQLite format 3\0", 16};
  constexpr std::string_view application = "PrMs";
  constexpr std::size_t application_at = 68;
  if (!is_file(file)) return false;
  std::array<char, application_at + application.size()> header{};
  std::ifstream stream(file, std::ios::binary);
  if (!stream.read(header.data(), header.size())) return false;
  const std::string_view bytes(header.data(), header.size());
  return bytes.starts_with(format) && bytes.substr(application_at) == application;
}

bool may_be_campaign(const std::filesystem::path& file) {
  return has_campaign_mark(file) ||
         (is_file(file) && ::faccessat(AT_FDCWD, file.c_str(), R_OK, AT_EACCESS) != 0);
}

std::shared_ptr<const Campaign> stored_campaign(const Store& store) {
  std::shared_ptr<const Campaign> campaign;
  store.read_one_state([&] {
    check_definition_digest(store);
    campaign = stored_campaign_unchecked(store);
  });
  return campaign;
}

std::shared_ptr<const Campaign> stored_campaign_unchecked(const Store& store) {
  std::shared_ptr<const Campaign> campaign =
      store.model().campaign_of({.text = store.definition(),
                                 .tables = store.data_tables(),
                                 .table_columns = store.table_columns()},
                                TableColumns::included, "stored definition");
  require_identity(*campaign, {.name = store.name(),
                               .seed = fmt::to_string(store.seed()),
                               .num_runs = fmt::to_string(store.num_runs())});
  return campaign;
}

}  // namespace proofmass::coordinator
