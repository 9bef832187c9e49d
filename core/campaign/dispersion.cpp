#include "core/campaign/dispersion.hpp"

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "core/error.hpp"

namespace proofmass {

std::span<const std::string_view> names_of(Law) {
  static constexpr std::array<std::string_view, 5> names{"uniform", "normal", "truncated_normal",
                                                         "fixed", "table"};
  return names;
}

namespace {

// Ten arc seconds, in rad.
constexpr double star_tracker_bias = 4.84813681109536e-5;

std::span<const std::string_view> element_names(const DrawGroup& group) {
  static constexpr std::array<std::string_view, 6> sensors{
      "sensor_1_x", "sensor_1_y", "sensor_1_z", "sensor_2_x", "sensor_2_y", "sensor_2_z"};
  static constexpr std::array<std::string_view, 3> axes{"x", "y", "z"};
  static constexpr std::array<std::string_view, 6> axis_pairs{"xy", "xz", "yx", "yz", "zx", "zy"};
  static constexpr std::array<std::string_view, 6> heads{"head_1_x", "head_1_y", "head_1_z",
                                                         "head_2_x", "head_2_y", "head_2_z"};
  if (group.count == axes.size()) return axes;
  if (group.name == "thruster_coupling_rad") return axis_pairs;
  if (group.name == "star_tracker_bias_rad") return heads;
  return sensors;
}

std::array<std::string, num_drawn> make_drawn_names() {
  std::array<std::string, num_drawn> names;
  for (const DrawGroup& group : draw_groups()) {
    const auto elements = element_names(group);
    PROOFMASS_EXPECT(elements.size() == group.count);
    for (std::size_t i = 0; i < group.count; ++i) {
      names[group.first + i] = fmt::format("{}.{}", group.name, elements[i]);
    }
  }
  return names;
}

}  // namespace

const std::array<DrawGroup, num_draw_groups>& draw_groups() {
  static constexpr std::array<DrawGroup, num_draw_groups> groups{{
      {"scale_factor_error", "K1 - 1 of each sensor and axis.", 1e-2, 0, 6},
      {"misalignment_rad", "Rotation θ of each sensor about each axis, rad.", 2.5e-3, 6, 6},
      {"coupling_rad", "Coupling η of each sensor's axes, rad.", 1e-4, 12, 6},
      {"quadratic_factor_s2_m", "K2 of each sensor and axis, s²/m.", 14000.0, 18, 6},
      {"offcentring_m", "Δ = O1O2, each axis, m.", 20e-6, 24, 3},
      {"centre_of_mass_offset_m", "Midpoint of O1 and O2 from the centre of mass, each axis, m.",
       1e-3, 27, 3},
      {"read_out_bias_m_s2", "b0 of each sensor and axis, m/s².", 1e-8, 30, 6},
      {"parasitic_acceleration_m_s2", "p (b1) on each test mass and axis, m/s².", 1.4e-8, 36, 6},
      {"thruster_scale_error", "Diagonal of [M_DF] - 1, each axis.", 0.05, 42, 3},
      {"thruster_coupling_rad", "Off the diagonal of [M_DF]: row, column, rad.", 0.017, 45, 6},
      {"angular_bias_rad_s2", "Bias of the measured angular acceleration, each axis, rad/s².", 1e-9,
       51, 3},
      {"star_tracker_bias_rad", "Bias of each star tracker head about each axis, rad (10 arcsec).",
       star_tracker_bias, 54, 6},
  }};
  return groups;
}

const std::array<std::string, num_drawn>& drawn_names() {
  static const std::array<std::string, num_drawn> names = make_drawn_names();
  return names;
}

DispersionSet nominal_dispersions() {
  DispersionSet dispersions;
  for (const DrawGroup& group : draw_groups()) {
    for (std::size_t i = group.first; i < group.first + group.count; ++i) {
      dispersions[i].law = Law::uniform;
      dispersions[i].minimum = -group.bound;
      dispersions[i].maximum = group.bound;
    }
  }
  return dispersions;
}

std::vector<std::size_t> table_elements(const DispersionSet& dispersions) {
  std::vector<std::size_t> elements;
  for (std::size_t i = 0; i < dispersions.size(); ++i) {
    if (dispersions[i].law == Law::table) elements.push_back(i);
  }
  return elements;
}

namespace {

/// Checks one law; `path` is that of its table in a campaign file.
class DispersionCheck {
 public:
  DispersionCheck(const Dispersion& dispersion, std::string_view path)
      : dispersion_(dispersion), path_(path) {}

  void run() const {
    check_finite("minimum", dispersion_.minimum);
    check_finite("maximum", dispersion_.maximum);
    check_finite("mean", dispersion_.mean);
    check_finite("standard_deviation", dispersion_.standard_deviation);
    check_finite("value", dispersion_.value);
    switch (dispersion_.law) {
      case Law::uniform:
        return check_interval();
      case Law::normal:
        return check_spread();
      case Law::truncated_normal:
        return check_truncation();
      case Law::fixed:
        return;
      case Law::table:
        return check_source();
    }
    refuse("law", fmt::format("{}", static_cast<int>(dispersion_.law)), "unknown law");
  }

 private:
  [[noreturn]] void refuse(std::string_view key, std::string_view value,
                           std::string_view rule) const {
    throw ConfigError(fmt::format("{}.{}", path_, key), value, rule);
  }

  void check_finite(std::string_view key, double value) const {
    if (!std::isfinite(value)) refuse(key, fmt::format("{}", value), "must be finite");
  }

  void check_interval() const {
    if (dispersion_.minimum < dispersion_.maximum) {
      // The width is a number that the draw computes with.
      check_finite("maximum", dispersion_.maximum - dispersion_.minimum);
      return;
    }
    refuse("maximum", fmt::format("{}", dispersion_.maximum),
           fmt::format("must be > minimum, {}", dispersion_.minimum));
  }

  void check_spread() const {
    if (dispersion_.standard_deviation > 0.0) return;
    refuse("standard_deviation", fmt::format("{}", dispersion_.standard_deviation), "must be > 0");
  }

  // Far tails and slivers would make a draw by rejection endless.
  void check_truncation() const {
    check_spread();
    check_interval();
    if (dispersion_.mean < dispersion_.minimum || dispersion_.mean > dispersion_.maximum) {
      refuse("mean", fmt::format("{}", dispersion_.mean),
             fmt::format("must be in [{}, {}]", dispersion_.minimum, dispersion_.maximum));
    }
    const double width = dispersion_.maximum - dispersion_.minimum;
    if (dispersion_.standard_deviation > 100.0 * width) {
      refuse("standard_deviation", fmt::format("{}", dispersion_.standard_deviation),
             fmt::format("must be <= 100 (maximum - minimum), {}", 100.0 * width));
    }
  }

  void check_source() const {
    if (dispersion_.file.empty()) refuse("file", "\"\"", "must name a file");
    if (dispersion_.column.empty()) refuse("column", "\"\"", "must name a column");
    check_length("file", dispersion_.file);
    check_length("column", dispersion_.column);
  }

  void check_length(std::string_view key, const std::string& name) const {
    if (name.size() <= data_name_size_max) return;
    refuse(key, fmt::format("{} bytes", name.size()),
           fmt::format("must be at most {}", data_name_size_max));
  }

  const Dispersion& dispersion_;
  std::string_view path_;
};

}  // namespace

void Dispersion::validate(std::string_view path) const { DispersionCheck(*this, path).run(); }

}  // namespace proofmass
