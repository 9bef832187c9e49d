#pragma once

namespace proofmass::wire {

/// Wakes a loop that polls file descriptors, from any thread.
class Wake {
 public:
  Wake();  ///< @throws Error if the system has no descriptor left.
  ~Wake();
  Wake(const Wake&) = delete;
  Wake& operator=(const Wake&) = delete;

  /// Readable from a notify() to the next take().
  [[nodiscard]] int descriptor() const { return descriptor_; }
  void notify() const;
  /// True if notify() was called since the last time.
  [[nodiscard]] bool take() const;

 private:
  int descriptor_;
};

}  // namespace proofmass::wire
