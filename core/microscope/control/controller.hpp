#pragma once

#include <complex>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "core/campaign/field.hpp"
#include "core/math/complex.hpp"
#include "core/microscope/control/margins.hpp"
#include "core/microscope/session/session.hpp"
#include "core/signal/band_pass.hpp"

namespace proofmass {

/// The loops of the satellite that a controller of a campaign file may close.
enum class ControlLoop : std::uint8_t {
  drag_free = 1,  ///< From the loop's input to Γ_DF, both in m/s².
  attitude = 2,   ///< From θ̂, rad, to the angular acceleration −C θ̂, rad/s².
};
[[nodiscard]] std::span<const std::string_view> names_of(ControlLoop);

inline constexpr std::size_t controller_order_max = 8;

/// C(s) = gain · Π (s − zero)/Π (s − pole) e^(−s·delay) on one axis of a loop, in place of the
/// nominal controller there: an entry of `[[controller]]` of a campaign file.
struct ControllerConfig {
  ControlLoop loop = ControlLoop::drag_free;
  Axis axis = Axis::x;
  double gain = 0.0;
  std::vector<std::complex<double>> zeros_rad_s;  ///< A complex one beside its conjugate.
  std::vector<std::complex<double>> poles_rad_s;
  std::int64_t delay_samples = 0;  ///< Beside the sample until a command acts.

  /// @param path  Of the entry, for messages.
  /// @throws ConfigError unless C is proper, real and itself stable.
  void validate(const std::string& path, double sample_period_s) const;
};

/// A controller at the sample rate, by the bilinear transform: C(z) is C(s) at
/// s = (2/T)(1 − z⁻¹)/(1 + z⁻¹), so at a frequency f what C is at tan(πfT)/(πT).
class SampledController {
 public:
  SampledController(const ControllerConfig& config, double sample_period_s);

  /// The next command.
  [[nodiscard]] double advance(double input);

  /// C(z), without memory.
  [[nodiscard]] ComplexDouble response(ComplexDouble z_inverse) const;
  [[nodiscard]] const Resonances& resonances() const { return resonances_; }

 private:
  Resonances resonances_;
  std::vector<Biquad> sections_;
  std::vector<BiquadState> states_;
  std::vector<double> delayed_;  ///< Commands of the last samples.
  std::size_t oldest_ = 0;
};

}  // namespace proofmass
