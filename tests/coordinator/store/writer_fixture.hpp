#pragma once

#include <condition_variable>

#include "coordinator/store/store_writer.hpp"
#include "tests/coordinator/store/store_fixture.hpp"

namespace proofmass::test {

/// Nothing is written, or tried again, because time passes.
inline coordinator::WriterConfig patient_config() {
  return {.commit_runs_max = 1'000'000,
          .commit_after = std::chrono::hours(1),
          .record_after = std::chrono::hours(1),
          .retry_after = std::chrono::hours(1),
          .look_after = std::chrono::hours(1)};
}

/// As in the texts of WriterTest.
inline std::string committed(const std::vector<std::uint64_t>& runs) {
  std::ostringstream text;
  text << "committed";
  for (const std::uint64_t run : runs) text << ' ' << run;
  return text.str();
}

/// A writer, and all its completions in order as text: `committed 3 4 5`, `compared 3 equal`,
/// `failed why`, `abandoned why`, `recovered`.
class WriterTest : public StoreTest {
 protected:
  static constexpr wire::CampaignId id{1};

  coordinator::StoreWriter& start(const coordinator::WriterConfig& config = patient_config()) {
    writer_ = std::make_unique<coordinator::StoreWriter>([this] { on_wake(); }, config);
    return *writer_;
  }
  /// A writer of a new file for so many runs.
  coordinator::StoreWriter& serve(std::uint64_t num_runs,
                                  const coordinator::WriterConfig& config = patient_config()) {
    start(config).open(id, create(num_runs));
    return *writer_;
  }
  void write_runs(std::uint64_t first, std::uint64_t end) {
    for (std::uint64_t run = first; run < end; ++run) writer_->write(id, delivery_of(run));
  }
  /// Ends the writer.
  void end() { writer_.reset(); }

  [[nodiscard]] std::vector<std::string> take_completions() {
    std::vector<std::string> texts;
    for (const coordinator::Completion& completion : writer_->take_completions()) {
      texts.push_back(std::visit([](const auto& kind) { return text_of(kind); }, completion));
    }
    return texts;
  }

  /// Waits for completions until one of them is `text`; returns all. A minute means: never.
  std::vector<std::string> wait_for(const std::string& text) {
    std::vector<std::string> all;
    while (std::find(all.begin(), all.end(), text) == all.end()) {
      {
        std::unique_lock lock(mutex_);
        if (!woken_.wait_for(lock, std::chrono::minutes(1), [this] { return is_woken_; })) {
          ADD_FAILURE() << "no completion " << text;
          return all;
        }
        is_woken_ = false;
      }
      const std::vector<std::string> texts = take_completions();
      all.insert(all.end(), texts.begin(), texts.end());
    }
    return all;
  }

 private:
  void on_wake() {
    {
      const std::lock_guard lock(mutex_);
      is_woken_ = true;
    }
    woken_.notify_one();
  }

  static std::string text_of(const coordinator::Committed& completion) {
    std::vector<std::uint64_t> numbers;
    for (const RunIndex run : completion.runs) numbers.push_back(run.value);
    return test::committed(numbers);
  }
  static std::string text_of(const coordinator::Compared& compared) {
    return "compared " + std::to_string(compared.comparison.run.value) +
           (compared.comparison.is_equal ? " equal" : " different");
  }
  static std::string text_of(const coordinator::StoreFailed& failed) {
    return (failed.is_abandoned ? "abandoned " : "failed ") + failed.text;
  }
  static std::string text_of(const coordinator::StoreRecovered&) { return "recovered"; }
  static std::string text_of(const coordinator::FileEvent& happened) {
    return std::string(happened.event.kind);
  }

  std::mutex mutex_;
  std::condition_variable woken_;
  bool is_woken_ = false;
  std::unique_ptr<coordinator::StoreWriter> writer_;
};

}  // namespace proofmass::test
