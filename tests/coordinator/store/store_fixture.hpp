#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "coordinator/store/store.hpp"
#include "core/campaign/campaign.hpp"

namespace proofmass::test {

/// A test with a directory of its own, removed afterwards.
class StoreTest : public ::testing::Test {
 protected:
  StoreTest() {
    std::string pattern = (std::filesystem::temp_directory_path() / "proofmass_XXXXXX").string();
    if (::mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("no temporary directory");
    directory_ = pattern;
  }
  ~StoreTest() override { std::filesystem::remove_all(directory_); }

  [[nodiscard]] std::filesystem::path directory() const { return directory_; }
  [[nodiscard]] std::filesystem::path file() const { return directory_ / "campaign.db"; }

  [[nodiscard]] std::set<std::string> file_names() const {
    std::set<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(directory_)) {
      names.insert(entry.path().filename());
    }
    return names;
  }

 private:
  std::filesystem::path directory_;
};

inline void write_file(const std::filesystem::path& path, const std::string& content) {
  std::ofstream(path, std::ios::binary) << content;
}

/// Harmonic environment, no tables.
inline Campaign campaign_of(std::uint64_t num_runs) {
  Campaign campaign;
  campaign.num_runs = num_runs;
  return campaign;
}

/// A result whose every number depends on the run; 1/3 needs all bits of a double.
inline RunResult result_of(std::uint64_t run, RunStatus status = RunStatus::completed) {
  RunResult result{.run = RunIndex{run}, .status = status, .num_draws = 2, .num_rounds = 3};
  for (std::size_t i = 0; i < num_parameters; ++i) {
    result.truth[i] = (static_cast<double>(run) + 1.0) / 3.0 * std::pow(10.0, -double(i));
    result.estimate[i] = result.truth[i] * (1.0 + 1e-3);
  }
  return result;
}

inline coordinator::Delivery delivery_of(std::uint64_t run) {
  return {.result = result_of(run), .worker = "worker-1", .attempt = 0, .compute_s = 0.5};
}

inline std::vector<coordinator::Delivery> deliveries_of(std::uint64_t first, std::uint64_t end) {
  std::vector<coordinator::Delivery> deliveries;
  for (std::uint64_t run = first; run < end; ++run) deliveries.push_back(delivery_of(run));
  return deliveries;
}

inline std::vector<RunResult> results_in(const coordinator::Store& store) {
  std::vector<RunResult> results;
  store.for_each_result([&](const RunResult& result) { results.push_back(result); });
  return results;
}

/// Text of the StoreError that `action` throws; empty if it throws none.
inline std::string store_error_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const coordinator::StoreError& error) {
    return error.what();
  }
  return {};
}

/// While it lives, the process has no more rights than an ordinary user: root may write anywhere.
class OrdinaryUser {
 public:
  OrdinaryUser() {
    if (::geteuid() == 0 && ::seteuid(65534) != 0) throw std::runtime_error("seteuid failed");
  }
  ~OrdinaryUser() {
    if (::getuid() == 0 && ::seteuid(0) != 0) std::abort();
  }
  OrdinaryUser(const OrdinaryUser&) = delete;
  OrdinaryUser& operator=(const OrdinaryUser&) = delete;
};

}  // namespace proofmass::test
