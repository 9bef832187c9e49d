#include "core/microscope/control/controller.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include "core/error.hpp"

namespace proofmass {
namespace {

using Roots = std::vector<std::complex<double>>;

/// Coefficients 1, c1, c2 of (1 − r z⁻¹)(1 − s z⁻¹).
using Quadratic = std::array<double, 3>;

std::string text_of(const std::complex<double>& root) {
  return fmt::format("[{}, {}]", root.real(), root.imag());
}

/// Quadratics of roots that are real or in conjugate pairs; of an odd number the last has one.
std::vector<Quadratic> quadratics(const Roots& roots) {
  std::vector<Quadratic> all;
  std::vector<double> reals;
  for (const std::complex<double>& root : roots) {
    if (root.imag() > 0.0) all.push_back({1.0, -2.0 * root.real(), std::norm(root)});
    if (root.imag() == 0.0) reals.push_back(root.real());
  }
  std::ranges::sort(reals);
  for (std::size_t i = 0; i < reals.size(); i += 2) {
    const double second = i + 1 < reals.size() ? reals[i + 1] : 0.0;
    all.push_back({1.0, -(reals[i] + second), reals[i] * second});
  }
  return all;
}

/// z of s by the bilinear transform; |s| is below 2/T.
std::complex<double> sampled(const std::complex<double>& s, double period_s) {
  const double rate = 2.0 / period_s;
  const ComplexDouble z =
      ComplexDouble(rate + s.real(), s.imag()) / ComplexDouble(rate - s.real(), -s.imag());
  return {z.real(), z.imag()};
}

/// Π (2/T − root), which is real.
double rate_product(const Roots& roots, double period_s) {
  ComplexDouble product = 1.0;
  for (const std::complex<double>& root : roots) {
    product = product * ComplexDouble(2.0 / period_s - root.real(), -root.imag());
  }
  return product.real();
}

std::vector<ComplexDouble> upper(const Roots& roots) {
  std::vector<ComplexDouble> upper;
  for (const std::complex<double>& root : roots) {
    if (root.imag() > 0.0) upper.emplace_back(root.real(), root.imag());
  }
  return upper;
}

void check_pairs(const std::string& path, const Roots& roots) {
  for (const std::complex<double>& root : roots) {
    if (std::ranges::count(roots, root) == std::ranges::count(roots, std::conj(root))) continue;
    throw ConfigError(path, text_of(root), "must stand beside its conjugate");
  }
}

void check_magnitudes(const std::string& path, const Roots& roots, double sample_period_s) {
  for (const std::complex<double>& root : roots) {
    if (std::abs(root) < 1.0 / sample_period_s) continue;
    throw ConfigError(path, text_of(root),
                      fmt::format("must be below 1/sample_period_s, {} rad/s: a faster one has no "
                                  "meaning at the sample rate",
                                  1.0 / sample_period_s));
  }
}

}  // namespace

std::span<const std::string_view> names_of(ControlLoop) {
  static constexpr std::array<std::string_view, 2> names{"drag_free", "attitude"};
  return names;
}

void ControllerConfig::validate(const std::string& path, double sample_period_s) const {
  if (gain == 0.0) throw ConfigError(path + ".gain", "0", "must close the loop");
  if (poles_rad_s.size() > controller_order_max || zeros_rad_s.size() > poles_rad_s.size()) {
    throw ConfigError(path + ".poles_rad_s", fmt::format("{} of them", poles_rad_s.size()),
                      fmt::format("must be at least as many as the {} zeros and at most {}",
                                  zeros_rad_s.size(), controller_order_max));
  }
  check_pairs(path + ".zeros_rad_s", zeros_rad_s);
  check_pairs(path + ".poles_rad_s", poles_rad_s);
  check_magnitudes(path + ".zeros_rad_s", zeros_rad_s, sample_period_s);
  check_magnitudes(path + ".poles_rad_s", poles_rad_s, sample_period_s);
  for (const std::complex<double>& pole : poles_rad_s) {
    if (pole.real() <= 0.0) continue;
    throw ConfigError(path + ".poles_rad_s", text_of(pole), "must have no positive real part");
  }
}

SampledController::SampledController(const ControllerConfig& config, double sample_period_s)
    : delayed_(static_cast<std::size_t>(config.delay_samples)) {
  const auto transformed = [&](const Roots& roots) {
    Roots all;
    for (const std::complex<double>& root : roots) all.push_back(sampled(root, sample_period_s));
    return all;
  };
  const double gain = config.gain * rate_product(config.zeros_rad_s, sample_period_s) /
                      rate_product(config.poles_rad_s, sample_period_s);
  const Roots poles = transformed(config.poles_rad_s);
  Roots zeros = transformed(config.zeros_rad_s);
  resonances_ = {upper(poles), upper(zeros)};
  zeros.resize(config.poles_rad_s.size(), -1.0);  // Those at infinity.
  const std::vector<Quadratic> numerators = quadratics(zeros);
  const std::vector<Quadratic> denominators = quadratics(poles);
  const std::size_t num_sections = std::max(numerators.size(), denominators.size());
  for (std::size_t i = 0; i < num_sections; ++i) {
    const Quadratic none{1.0, 0.0, 0.0};
    const Quadratic b = i < numerators.size() ? numerators[i] : none;
    const Quadratic a = i < denominators.size() ? denominators[i] : none;
    sections_.push_back({b[0], b[1], b[2], a[1], a[2]});
  }
  if (sections_.empty()) sections_.push_back({1.0, 0.0, 0.0, 0.0, 0.0});
  Biquad& first = sections_.front();
  for (double* const b : {&first.b0, &first.b1, &first.b2}) *b *= gain;
  states_.resize(sections_.size());
}

double SampledController::advance(double input) {
  for (std::size_t i = 0; i < sections_.size(); ++i) states_[i].filter(sections_[i], input);
  if (delayed_.empty()) return input;
  const double command = std::exchange(delayed_[oldest_], input);
  oldest_ = (oldest_ + 1) % delayed_.size();
  return command;
}

ComplexDouble SampledController::response(ComplexDouble z_inverse) const {
  ComplexDouble product = 1.0;
  for (std::size_t i = 0; i < delayed_.size(); ++i) product = product * z_inverse;
  for (const Biquad& section : sections_) {
    const auto polynomial = [&](double c0, double c1, double c2) {
      return c0 + z_inverse * (c1 + c2 * z_inverse);
    };
    product = product * (polynomial(section.b0, section.b1, section.b2) /
                         polynomial(1.0, section.a1, section.a2));
  }
  return product;
}

}  // namespace proofmass
