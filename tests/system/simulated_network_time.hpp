#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <queue>
#include <random>
#include <utility>
#include <vector>

namespace proofmass::test {

using TimePoint = std::chrono::steady_clock::time_point;
using Duration = std::chrono::steady_clock::duration;

/// All that is random in a simulated world follows from its seed.
class Randomness {
 public:
  explicit Randomness(std::uint64_t seed) : engine_(seed) {}

  double uniform(double maximum) {
    return maximum * static_cast<double>(engine_() >> 11) / 9007199254740992.0;
  }
  bool happens(double probability) { return uniform(1.0) < probability; }
  std::uint64_t below(std::uint64_t end) { return engine_() % end; }
  std::uint64_t number() { return engine_() | 1U; }  ///< Not 0.
  Duration duration(double seconds_max) {
    return std::chrono::duration_cast<Duration>(
        std::chrono::duration<double>(uniform(seconds_max)));
  }

 private:
  std::mt19937_64 engine_;
};

/// Things that will happen, in the order of their time.
class Agenda {
 public:
  void add(Duration delay, std::function<void()> what) {
    entries_.push({now_ + delay, next_++, std::move(what)});
  }

  /// Makes the next thing happen.
  void step() {
    const Entry entry = entries_.top();
    entries_.pop();
    now_ = entry.when;
    entry.what();
  }

  [[nodiscard]] TimePoint now() const { return now_; }

 private:
  struct Entry {
    TimePoint when;
    std::uint64_t number;
    std::function<void()> what;
    bool operator<(const Entry& other) const {
      return std::pair(other.when, other.number) < std::pair(when, number);
    }
  };
  std::priority_queue<Entry> entries_;
  std::uint64_t next_ = 0;
  TimePoint now_{};
};

}  // namespace proofmass::test
