#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "coordinator/net/service.hpp"
#include "coordinator/table/table.hpp"
#include "proto/client.pb.h"
#include "proto/wire/messages.hpp"

namespace proofmass::coordinator {

enum class DisplayMode : std::uint8_t {
  bar,    ///< One line, written again and again: for a terminal.
  lines,  ///< A line every ten percent, and when storing begins to fail or works again.
  quiet,  ///< Notes only.
};

/// The progress towards so many runs: the most that a campaign with a stop rule may take, which
/// asks for more at each check, so that it never goes back; or those of a part of a campaign.
/// @param num_done_beside  Runs that were done already and are not of the part.
[[nodiscard]] proto::CampaignStatus out_of(proto::CampaignStatus status, std::uint64_t num_runs,
                                           std::uint64_t num_done_beside = 0);

/// A line of at most `columns_max` columns: runs done, percent, rate, time left; or that nothing
/// can be stored. Before the first run is done, how many the workers have.
[[nodiscard]] std::string progress_bar(const proto::CampaignStatus& status,
                                       std::size_t columns_max);

/// The text of progress_bar() without the bar.
[[nodiscard]] std::string progress_line(const proto::CampaignStatus& status);

/// Shows a campaign's progress and notes beside it.
class ProgressDisplay {
 public:
  /// @param stream  Must outlive this object; standard error.
  ProgressDisplay(DisplayMode mode, std::FILE* stream);
  ~ProgressDisplay();  ///< Ends the bar's line.
  ProgressDisplay(const ProgressDisplay&) = delete;
  ProgressDisplay& operator=(const ProgressDisplay&) = delete;

  /// May be called as often as one likes.
  void update(const proto::CampaignStatus& status);
  /// A line of its own that stays.
  void note(std::string_view text, Tone tone = Tone::plain);

 private:
  void show_bar(const proto::CampaignStatus& status);

  DisplayMode mode_;
  std::FILE* stream_;
  bool has_bar_ = false;
  std::string shown_;  ///< The bar, or what the last line was about.
};

/// Worker processes of this machine, of one thread each: what kills one costs the runs of that
/// thread only. They end with this process, however it ends.
class WorkerProcesses {
 public:
  /// A worker that ended by itself.
  struct Exit {
    std::string name;
    pid_t process_id = 0;
    std::string text;  ///< `killed by signal 9 (Killed)`, `exit code 1`.
    /// By reason_of_end(), with the kernel's want of memory since the last call.
    wire::LossReason reason = wire::LossReason::failed;
    bool is_refusal = false;  ///< It cannot do what its options ask, and said so.
  };

  WorkerProcesses(std::filesystem::path executable, std::string endpoint);
  ~WorkerProcesses();  ///< Ends them: asks, waits for a moment, kills.
  WorkerProcesses(const WorkerProcesses&) = delete;
  WorkerProcesses& operator=(const WorkerProcesses&) = delete;

  /// @throws Error if the process cannot be made.
  void start(const std::string& name);
  /// Starts `local-1`, `local-2` and so on.
  /// @param gpus  As for the option --gpu of a worker; the first one has the cards.
  void start_local(std::uint64_t count, const std::string& gpus);

  /// Those that have ended since the last call; does not wait.
  [[nodiscard]] std::vector<Exit> take_exits();
  /// Those that have not ended, as far as that was seen.
  [[nodiscard]] std::size_t count() const { return processes_.size(); }

 private:
  struct Process {
    std::string name;
    pid_t process_id = 0;
  };

  void wait_until_ended(int milliseconds_max);
  [[nodiscard]] wire::LossReason reason_of(int status);

  std::filesystem::path executable_;
  std::string endpoint_;
  std::string gpus_ = "none";  ///< Of `local-1`.
  std::vector<Process> processes_;
  std::uint64_t num_oom_kills_;  ///< As the kernel counted them when last looked at.
};

/// The local workers of a campaign: starts others in the place of those that die.
class LocalWorkers {
 public:
  /// @param service, display, processes  Outlive this object.
  LocalWorkers(Service& service, ProgressDisplay& display, WorkerProcesses& processes);

  /// @throws Error if workers end, or their model crashes, again and again without finishing a run,
  ///         unless that is the fault of single runs, which the dispatch finds out; or if all of
  ///         them lack the model.
  void replace_dead();

 private:
  void replace(const WorkerProcesses::Exit& exit);
  void check(const WorkerProcesses::Exit& exit, const std::string& runs);

  Service& service_;
  ProgressDisplay& display_;
  WorkerProcesses& processes_;
  std::string host_;
  int num_failures_ = 0;  ///< In a row, without a finished run.
  std::uint64_t num_done_at_failure_ = 0;
};

}  // namespace proofmass::coordinator
