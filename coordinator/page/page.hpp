#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "coordinator/dispatch/outbox.hpp"
#include "coordinator/net/service.hpp"
#include "coordinator/page/page_access.hpp"

namespace proofmass::coordinator {

/// Settings of a live page.
struct PageConfig {
  PageAddress address;
  /// Secret that visitors must show; needed for addresses that other machines reach.
  std::optional<std::filesystem::path> token_file = {};

  /// @throws InvalidArgument `page = HOST:PORT (rule)` if such an address has no token; Error if
  /// the
  ///         token file cannot be used.
  void validate() const;
};

/// Descriptors that a live page may take beside those of the service.
[[nodiscard]] std::uint64_t page_descriptors_max();

/// The live page of a service: an HTTP server in a thread of its own and a thread that reads
/// campaign databases. Neither touches the service: on_turn() hands them snapshots.
class Page {
 public:
  /// Listens. Warns if other machines can reach the address, because nothing is encrypted.
  /// @throws Error as PageConfig::validate() does, or if the address cannot be used.
  Page(const PageConfig& config, const Log& log);
  ~Page();  ///< Waits for a database that is being read.
  Page(const Page&) = delete;
  Page& operator=(const Page&) = delete;

  /// To be called in each turn of the service's loop, in its thread.
  void on_turn(const Service& service);

  [[nodiscard]] std::string url() const;  ///< `http://127.0.0.1:5557/`

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace proofmass::coordinator
