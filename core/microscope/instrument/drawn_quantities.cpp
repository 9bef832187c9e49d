#include "core/microscope/instrument/drawn_quantities.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "core/error.hpp"

namespace proofmass {
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
  static constexpr std::array<std::string_view, 1> pair{"masses_2_1"};
  if (group.count == pair.size()) return pair;
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
      {eotvos_parameter_group, "δ of mass 2 against mass 1; test sessions estimate it.", 1e-12, 60,
       1},
  }};
  return groups;
}

const DrawGroup& draw_group(std::string_view name) {
  const auto group = std::ranges::find(draw_groups(), name, &DrawGroup::name);
  PROOFMASS_EXPECT(group != draw_groups().end());
  return *group;
}

const std::array<std::string, num_drawn>& drawn_names() {
  static const std::array<std::string, num_drawn> names = make_drawn_names();
  return names;
}

LawSet law_set(const DispersionSet& dispersions) {
  return {.names = drawn_names(), .laws = dispersions, .table = "dispersion"};
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
  dispersions[index_of_eotvos_parameter] = {.law = Law::fixed, .file = {}, .column = {}};
  return dispersions;
}

std::string_view drawn_unit(std::size_t quantity) {
  // A name ends in its unit; `_s2_m` ends in `_m` too, so that the longer come first.
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 5> units{
      {{"_rad_s2", "rad/s²"}, {"_m_s2", "m/s²"}, {"_s2_m", "s²/m"}, {"_rad", "rad"}, {"_m", "m"}}};
  const std::string_view name = drawn_names()[quantity];
  const std::string_view group = name.substr(0, name.find('.'));
  const auto found =
      std::ranges::find_if(units, [&](const auto& unit) { return group.ends_with(unit.first); });
  return found == units.end() ? "1" : found->second;
}

double drawn_magnitude_max(std::size_t quantity) {
  const auto after = std::ranges::upper_bound(draw_groups(), quantity, {}, &DrawGroup::first);
  return 1000.0 * std::prev(after)->bound;
}

bool is_drawn_in_range(const DispersionSet& dispersions, const DrawnValues& values) {
  for (std::size_t i = 0; i < num_drawn; ++i) {
    if (dispersions[i].law != Law::derived) continue;
    if (!(std::fabs(values[i]) <= drawn_magnitude_max(i))) return false;
  }
  return true;
}

DrawnValues draw_values(const DispersionSet& dispersions, std::uint64_t seed, RunIndex run,
                        std::uint32_t draw, std::span<const double> table_values,
                        const SamplingDesign& design) {
  DrawnValues values{};
  draw_values(law_set(dispersions), seed, run, draw, table_values, design, values);
  return values;
}

}  // namespace proofmass
