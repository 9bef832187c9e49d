#pragma once

namespace proofmass::coordinator {

/// Wakes a loop that polls file descriptors, from any thread.
class Wake {
 public:
  Wake();  ///< @throws Error if the system has no descriptor left.
  ~Wake();
  Wake(const Wake&) = delete;
  Wake& operator=(const Wake&) = delete;

  /// Readable from a notify() to the next clear().
  [[nodiscard]] int descriptor() const { return descriptor_; }
  void notify() const;
  void clear() const;

 private:
  int descriptor_;
};

}  // namespace proofmass::coordinator
