#pragma once

#include <cmath>
#include <span>

namespace proofmass {

/// Sum whose rounding error does not grow with the number of terms [Neumaier1974]: what each
/// addition loses is added up apart.
class CompensatedSum {
 public:
  void add(double term) {
    const double sum = sum_ + term;
    const bool term_is_small = std::abs(sum_) >= std::abs(term);
    lost_ += term_is_small ? (sum_ - sum) + term : (term - sum) + sum_;
    sum_ = sum;
  }
  [[nodiscard]] double value() const { return sum_ + lost_; }

 private:
  double sum_ = 0.0;
  double lost_ = 0.0;
};

/// Compensated sum in the order of the values; 0 for none.
[[nodiscard]] inline double compensated_sum(std::span<const double> values) {
  CompensatedSum sum;
  for (const double value : values) sum.add(value);
  return sum.value();
}

}  // namespace proofmass
