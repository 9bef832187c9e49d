#pragma once

#include <unistd.h>

#include <utility>

namespace proofmass::wire {

/// A file descriptor, closed at the end of its owner's life.
class Descriptor {
 public:
  /// @param number  As open(2) returns it; negative: none.
  explicit Descriptor(int number = -1) : number_(number) {}
  ~Descriptor() {
    if (number_ >= 0) ::close(number_);
  }
  Descriptor(Descriptor&& other) noexcept : number_(other.release()) {}
  Descriptor& operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }

  [[nodiscard]] int number() const { return number_; }
  /// Leaves the descriptor open, and to the caller.
  [[nodiscard]] int release() { return std::exchange(number_, -1); }

 private:
  int number_;
};

}  // namespace proofmass::wire
