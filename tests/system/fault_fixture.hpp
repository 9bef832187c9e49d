#pragma once

#include <cstddef>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/system/campaign_process.hpp"

namespace proofmass::test {

/// A coordinator, workers and clients, all of them real processes whose
/// surroundings fail. A campaign `null` is there for workers whose runs cost nothing, beside
/// short.toml, whose name is hardy2013.
class FaultTest : public CampaignProcess {
 protected:
  using Processes = std::vector<std::unique_ptr<Process>>;

  void SetUp() override;

  /// Gives the campaign `null` another number of runs than 4000.
  void write_null_campaign(std::size_t count);
  /// The same for a coordinator that serves it already with fewer runs.
  /// @param further  Arguments of the submission.
  void extend_null_campaign(std::size_t count, const Arguments& further = {});
  /// A campaign file NAME.toml with so many runs.
  void write_campaign(const std::string& name, std::size_t count) const;

  /// Starts one of the programs, behind words such as `env A=B`.
  [[nodiscard]] Process start_behind(const Arguments& prefix, const std::string& name,
                                     const std::string& program, const Arguments& arguments) const;
  /// proofmass-coordinator at `workers_endpoint`; its log in NAME.err.
  [[nodiscard]] Process coordinator(const std::string& name, const Arguments& further,
                                    const Arguments& prefix = {}) const;
  /// proofmass-worker with one thread.
  [[nodiscard]] Process worker(const std::string& name, const Arguments& further = {},
                               const Arguments& prefix = {}) const;
  /// proofmass-null-worker, likewise, whose batches of 16 runs take 20 ms.
  [[nodiscard]] Process null_worker(const std::string& name, const Arguments& further = {},
                                    const Arguments& prefix = {}) const;

  /// What a command of `proofmass` writes; it must succeed.
  [[nodiscard]] std::string told(const Arguments& command) const;
  /// The campaign in the output of `proofmass status --json`.
  [[nodiscard]] nlohmann::json status_of(const std::string& campaign) const;

  /// Waits until a program has written the text to its log.
  void wait_for_log(const std::string& name, const std::string& text) const;
  /// Number of lines in a program's log that hold the text.
  [[nodiscard]] std::size_t num_log_lines(const std::string& name, const std::string& text) const;

  [[nodiscard]] std::filesystem::path file_of(const std::string& campaign) const;
  /// Runs that are stored; 0 if the campaign is not there yet.
  [[nodiscard]] std::size_t num_done(const std::string& campaign) const;
  void wait_for_done(const std::string& campaign, std::size_t count) const;
  /// Ends a coordinator without --exit-when-done when all runs of `null` are stored, and with it
  /// the workers that know it: before that so many must have registered, as one that is still on
  /// its way would wait for another coordinator.
  void end_when_done(Process& coordinator, const std::string& name, std::size_t num_registered);
  [[nodiscard]] std::string digest(const std::string& campaign) const;
  /// Of the same campaign, computed by one worker without any fault.
  [[nodiscard]] std::string undisturbed_digest(const std::string& campaign) const;

  std::size_t num_null_runs = 0;
  std::string served = "served";  ///< The coordinator's directory.
  std::string workers_endpoint;
  std::string clients_endpoint;
};

}  // namespace proofmass::test
