#pragma once

#include <cmath>

namespace proofmass {

/// A complex number of two finite doubles whose magnitudes lie well inside the range of doubles.
///
/// std::complex calls the compiler's run-time library for quotients, and without optimisation for
/// products. That library may contract a·b + c into one rounding: on ARM64 it does, on x86-64 it
/// does not. These operators round each product and each sum by itself, and give the bits that
/// std::complex has on x86-64.
class ComplexDouble {
 public:
  constexpr ComplexDouble() = default;
  // Not explicit: real numbers are complex numbers.
  constexpr ComplexDouble(double real, double imaginary = 0.0)
      : real_(real), imaginary_(imaginary) {}

  [[nodiscard]] constexpr double real() const { return real_; }
  [[nodiscard]] constexpr double imag() const { return imaginary_; }

 private:
  double real_ = 0.0;
  double imaginary_ = 0.0;
};

inline ComplexDouble operator+(ComplexDouble a, ComplexDouble b) {
  return {a.real() + b.real(), a.imag() + b.imag()};
}
inline ComplexDouble& operator+=(ComplexDouble& a, ComplexDouble b) { return a = a + b; }
inline ComplexDouble operator-(ComplexDouble a, ComplexDouble b) {
  return {a.real() - b.real(), a.imag() - b.imag()};
}
inline ComplexDouble operator*(double a, ComplexDouble b) { return {a * b.real(), a * b.imag()}; }
inline ComplexDouble operator*(ComplexDouble a, ComplexDouble b) {
  return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}
inline ComplexDouble operator/(ComplexDouble a, double b) { return {a.real() / b, a.imag() / b}; }

/// By the smaller part of b over the larger one [Smith1962].
inline ComplexDouble operator/(ComplexDouble a, ComplexDouble b) {
  if (std::abs(b.real()) < std::abs(b.imag())) {
    const double ratio = b.real() / b.imag();
    const double denominator = b.real() * ratio + b.imag();
    return {(a.real() * ratio + a.imag()) / denominator,
            (a.imag() * ratio - a.real()) / denominator};
  }
  const double ratio = b.imag() / b.real();
  const double denominator = b.imag() * ratio + b.real();
  return {(a.imag() * ratio + a.real()) / denominator, (a.imag() - a.real() * ratio) / denominator};
}

/// |a|².
inline double norm(ComplexDouble a) { return a.real() * a.real() + a.imag() * a.imag(); }

inline ComplexDouble conjugate(ComplexDouble a) { return {a.real(), -a.imag()}; }

}  // namespace proofmass
