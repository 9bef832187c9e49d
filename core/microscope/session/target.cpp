#include "core/microscope/session/target.hpp"

#include <array>
#include <span>

#include "core/error.hpp"
#include "core/microscope/session/session_names.hpp"

namespace proofmass {
namespace {

using enum SessionTarget;
using enum ExcitationKind;
using enum MassMotion;

constexpr auto no_product = Product::none;
constexpr auto common_drag_free = DragFreeSource::common;
constexpr std::optional<DragFreeSource> any_drag_free;

constexpr auto quiet = ExcitationRule::none;
constexpr auto shaken = ExcitationRule::stimulus;

constexpr Stimulus no_stimulus{};
constexpr Stimulus turned_about_z{attitude, Axis::z};
constexpr Stimulus moved_along(Axis axis) { return {test_mass, axis}; }
constexpr Stimulus pushed_along(Axis axis) { return {drag_free, axis}; }

// The slopes: Γ_mes,dx = ½ [T − In]_xj a_c11 Δ_j; a_c1j · ½([T]_jj − [T]_xx) Δ_TM sin(2π f_TM t),
// as the masses move along sensor axes; a_d1j Γ_mes,cj; K2d/K1c² Γ_mes,cx²; and
// 2 Γ_mes,dx = ±K2k/K1k² Γ_mes,kx² for the mass that moves.
constexpr std::array<TargetInfo, num_session_targets> targets{{
    {a_c11_delta_x, "a_c11_delta_x", quiet, no_stimulus, common_drag_free, Signal::gradient_xx,
     no_product, 2.0, SignalSet::all},
    {a_c11_delta_z, "a_c11_delta_z", quiet, no_stimulus, common_drag_free, Signal::gradient_xz,
     no_product, 2.0, SignalSet::all},
    {a_c11_delta_y, "a_c11_delta_y", shaken, turned_about_z, common_drag_free, Signal::gradient_xy,
     no_product, 2.0, SignalSet::all},
    {a_c12, "a_c12", shaken, moved_along(Axis::y), common_drag_free, Signal::product,
     Product::modulated_yy, 1.0, SignalSet::common},
    {a_c13, "a_c13", shaken, moved_along(Axis::z), common_drag_free, Signal::product,
     Product::modulated_zz, 1.0, SignalSet::common},
    {a_d11_prime, "a_d11_prime", shaken, pushed_along(Axis::x), common_drag_free, Signal::common_x,
     no_product, 1.0, SignalSet::common},
    {a_d12, "a_d12", shaken, pushed_along(Axis::y), common_drag_free, Signal::common_y, no_product,
     1.0, SignalSet::common},
    {a_d13, "a_d13", shaken, pushed_along(Axis::z), common_drag_free, Signal::common_z, no_product,
     1.0, SignalSet::common},
    {k2d, "k2d", shaken, pushed_along(Axis::x), common_drag_free, Signal::product,
     Product::common_squared, 1.0, SignalSet::common},
    {k2_sensor_1, "k2_sensor_1", shaken, Stimulus{test_mass, Axis::x, mass_1},
     DragFreeSource::sensor_2, Signal::product, Product::sensor_1_squared, 2.0, SignalSet::common},
    {k2_sensor_2, "k2_sensor_2", shaken, Stimulus{test_mass, Axis::x, mass_2},
     DragFreeSource::sensor_1, Signal::product, Product::sensor_2_squared, -2.0, SignalSet::common},
    {no_target, "no_target", ExcitationRule::any, no_stimulus, any_drag_free, Signal::product,
     no_product, 0.0, SignalSet::common},
}};

constexpr bool are_in_order() {
  for (std::size_t i = 0; i < targets.size(); ++i) {
    if (index(targets[i].target) != i) return false;
  }
  return true;
}
static_assert(are_in_order());

constexpr std::array<std::string_view, num_session_targets> target_names = [] {
  std::array<std::string_view, num_session_targets> names{};
  for (std::size_t i = 0; i < targets.size(); ++i) names[i] = targets[i].name;
  return names;
}();

}  // namespace

const TargetInfo& target_info(SessionTarget target) {
  PROOFMASS_EXPECT(index(target) < targets.size());
  return targets[index(target)];
}

std::span<const std::string_view> names_of(SessionTarget) { return target_names; }

const char* name_of(SessionTarget target) { return target_info(target).name.data(); }

}  // namespace proofmass
