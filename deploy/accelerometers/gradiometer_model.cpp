#include <cmath>
#include <string>

#include "core/definition/definition_text.hpp"
#include "gradiometer.hpp"
#include "normal_equations.hpp"

namespace proofmass {
namespace {

constexpr std::array<std::string_view, 3> axes{"x", "y", "z"};
constexpr std::array<std::string_view, 3> coupling_names{"yx", "zy", "yz"};

struct Unit {
  std::string_view suffix, unit;
  double display_scale;
  std::string_view display_unit;
};
constexpr Unit number{"", "1", 1e-6, "1e-6"}, curvature{"_s2_m", "s²/m", 1.0, "s²/m"},
    metres{"_m", "m", 1e-6, "µm"};

/// Quantities of one kind: an element of each is Σ factor · unknown.
struct Group {
  std::string_view name, symbol;
  Unit unit;
  std::vector<std::pair<std::size_t, double>> terms;  ///< Of the first element: unknown, factor.
  std::vector<std::string> elements;                  ///< Their unknowns are neighbours.
  double Gradiometer::*objective;                     ///< Null if there is none.
};

std::vector<std::string> matrix_elements() {
  std::vector<std::string> elements;
  for (const std::string_view row : axes) {
    for (const std::string_view column : axes) elements.push_back(fmt::format("{}{}", row, column));
  }
  return elements;
}

const std::vector<Group>& groups() {
  using G = Gradiometer;
  constexpr std::size_t m = Unknowns::matrix, k = Unknowns::quadratic, w = Unknowns::coupling,
                        r = Unknowns::place;
  const std::vector<std::string> matrix = matrix_elements(), vector(axes.begin(), axes.end()),
                                 coupling(coupling_names.begin(), coupling_names.end());
  constexpr auto dm = &G::matrix_objective, dk = &G::quadratic_objective_s2_m,
                 dw = &G::coupling_objective_m, dr = &G::place_objective_m;
  constexpr std::nullptr_t none = nullptr;
  const std::vector<std::pair<std::size_t, double>> w_yx_less_r_z{
      {w, 0.5}, {w + 3, -0.5}, {r + 2, -0.5}, {r + 4, 0.5}};
  static const std::vector<Group> groups{
      {"dm_2_c13", "dM₂ − dM_c13", number, {{m, -0.5}, {m + 9, 1.0}, {m + 18, -0.5}}, matrix, dm},
      {"dm_d13", "dM_d13", number, {{m, 0.5}, {m + 18, -0.5}}, matrix, dm},
      {"k_1", "K₁", curvature, {{k, 1.0}}, vector, dk},
      {"k_2", "K₂", curvature, {{k + 3, 1.0}}, vector, dk},
      {"k_3", "K₃", curvature, {{k + 6, 1.0}}, vector, dk},
      // Along x all three sensors feel nearly the same a_ng, and a common square of it looks like
      // another a_ng: these two are told much better than what the three K_x have in common.
      {"k_2_c13", "K₂ − K_c13", curvature, {{k, -0.5}, {k + 3, 1.0}, {k + 6, -0.5}}, {"x"}, dk},
      {"k_d13", "K_d13", curvature, {{k, 0.5}, {k + 6, -0.5}}, {"x"}, dk},
      {"w_d13", "W_d13", metres, {{w, 0.5}, {w + 3, -0.5}}, coupling, none},
      {"w_2_c13", "W₂ − W_c13", metres, {{w, -0.5}, {w + 3, -0.5}}, coupling, dw},
      {"dr_c13", "δr_c13", metres, {{r, 1.0}}, {"x"}, dr},
      {"dr_c13", "δr_c13", metres, {{r + 1, 0.5}, {r + 3, 0.5}}, {"y", "z"}, dr},
      {"dr_d13", "δr_d13", metres, {{r + 1, 0.5}, {r + 3, -0.5}}, {"y", "z"}, dr},
      // The y axis reads this times ω̇_x. What tells the two apart, a common rotation of all axes
      // imitates, but for what the slowest lines tell.
      {"w_yx_dr_z", "W_yx − δr_z", metres, w_yx_less_r_z, {"d13"}, dr},
  };
  return groups;
}

std::vector<std::string> drawn_names() {
  std::vector<std::string> names;
  const auto add = [&](std::string_view of, const auto& elements) {
    for (const auto& element : elements) names.push_back(fmt::format("{}.{}", of, element));
  };
  for (const char* const of : {"dm_1", "dm_2", "dm_3"}) add(of, matrix_elements());
  for (const char* const of : {"k_1_s2_m", "k_2_s2_m", "k_3_s2_m"}) add(of, axes);
  for (const char* const of : {"w_1_m", "w_3_m"}) add(of, coupling_names);
  add("dr_1_m", axes);
  add("dr_3_m", std::array{"y", "z"});
  return names;
}

Matrix3<double> unit_matrix() { return {{{{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}}}; }

}  // namespace

std::array<Accelerometer, 3> sensors_of(std::span<const double> unknowns, double length_m) {
  std::array<Accelerometer, 3> sensors{};
  for (std::size_t i = 0; i < 3; ++i) {
    sensors[i].matrix = unit_matrix();
    for (std::size_t p = 0; p < 3; ++p) {
      for (std::size_t q = 0; q < 3; ++q) {
        sensors[i].matrix.row[p][q] += unknowns[Unknowns::matrix + 9 * i + 3 * p + q];
      }
      sensors[i].quadratic[p] = unknowns[Unknowns::quadratic + 3 * i + p];
    }
  }
  for (std::size_t w = 0; w < 3; ++w) {
    const auto [row, column] = coupling_places[w];
    sensors[0].coupling.row[row][column] = unknowns[Unknowns::coupling + w];
    sensors[2].coupling.row[row][column] = unknowns[Unknowns::coupling + 3 + w];
  }
  const auto place = unknowns.subspan(Unknowns::place);
  sensors[0].place_m = {0.5 * length_m + place[0], place[1], place[2]};
  sensors[2].place_m = {-0.5 * length_m + place[0], place[3], place[4]};
  return sensors;
}

double Combination::of(std::span<const double> unknowns) const {
  double sum = 0.0;
  for (const auto& [unknown, coefficient] : terms) sum += coefficient * unknowns[unknown];
  return sum;
}

const std::vector<Combination>& combinations() {
  static const std::vector<Combination> all = [] {
    std::vector<Combination> all;
    for (const Group& group : groups()) {
      for (std::size_t element = 0; element < group.elements.size(); ++element) {
        Combination combination{group.terms};
        for (auto& [unknown, factor] : combination.terms) unknown += element;
        all.push_back(std::move(combination));
      }
    }
    return all;
  }();
  return all;
}

std::span<const SettingInfo<Gradiometer>> Gradiometer::infos() {
  using S = Gradiometer;
  static const std::array<SettingInfo<S>, 17> infos{{
      {{"orbit.altitude_m", "circular", range::between(1e5, 1e8)}, &S::altitude_m},
      {{"sensor.distance_m", "of the outer two", range::between(1e-3, 1e3)}, &S::length_m},
      {{"shaking.duration_s", "even, no prime factor above 5; a sample a second",
        range::between(3600.0, 1e6)},
       &S::duration_s},
      {{"shaking.linear_m_s2_rthz", "from 0.06 to 0.1 Hz, each axis", range::between(1e-9, 1.0)},
       &S::linear_m_s2_rthz},
      {{"shaking.angular_rad_s2_rthz", "likewise", range::between(1e-9, 1e-4)},
       &S::angular_rad_s2_rthz},
      {{"shaking.lowest_hz", "of shaking and fit", range::between(1e-6, 0.01)}, &S::lowest_hz},
      {{"science.drag_m_s2", "along y and z, once per orbit", range::between(0.0, 1e-3)},
       &S::drag_m_s2},
      {{"noise.factor", "of all noise; 0: none", range::between(0.0, 1e6)}, &S::noise_factor},
      {{"deviation.matrix", "of each element of dM", range::between(0.0, 0.01)}, &S::matrix},
      {{"deviation.quadratic_s2_m", "of K", range::between(0.0, 1e3)}, &S::quadratic_s2_m},
      {{"deviation.coupling_m", "of W", range::between(0.0, 0.01)}, &S::coupling_m},
      {{"deviation.place_m", "of δr", range::between(0.0, 0.01)}, &S::place_m},
      {{"objective.matrix", "of dM_d13; of dM₂ − dM_c13, chosen", range::positive},
       &S::matrix_objective},
      {{"objective.quadratic_s2_m", "", range::positive}, &S::quadratic_objective_s2_m},
      {{"objective.coupling_m", "of W₂ − W_c13; chosen", range::positive},
       &S::coupling_objective_m},
      {{"objective.place_m", "", range::positive}, &S::place_objective_m},
      {{"objective.science_ratio", "of the residual of a_ng", range::positive},
       &S::ratio_objective},
  }};
  return infos;
}

std::span<const DrawnQuantity> Gradiometer::drawn() {
  static const std::vector<std::string> names = drawn_names();
  static const std::vector<DrawnQuantity> drawn = [] {
    std::vector<DrawnQuantity> drawn;
    for (std::size_t i = 0; i < names.size(); ++i) {
      const bool is_length = i >= Unknowns::coupling;
      drawn.push_back({names[i], is_length ? "m" : i >= Unknowns::quadratic ? "s²/m" : "1"});
    }
    return drawn;
  }();
  return drawn;
}

void Gradiometer::check() const {
  if (duration_s != std::floor(duration_s) || !FourierTransform::can(num_samples())) {
    throw ConfigError("shaking.duration_s", detail::number_text(duration_s),
                      "must be an even whole number without prime factors above 5");
  }
}

ResultSchema Gradiometer::results() const {
  static const std::vector<std::string> symbols = [] {
    std::vector<std::string> symbols;
    for (const Group& group : groups()) {
      for (const std::string& element : group.elements) {
        symbols.push_back(fmt::format("({}) {}", group.symbol, element));
      }
    }
    return symbols;
  }();
  ResultSchema schema{.health = {{"uncalibrated_ratio", "", "1"}, {"floor_ratio", "", "1"}},
                      .loss_causes = {"not_observed"},
                      .loss_sessions = {"shaking"}};
  for (const Group& group : groups()) {
    for (const std::string& element : group.elements) {
      schema.quantities.push_back({.name = fmt::format("{}_{}", group.name, element),
                                   .unit_suffix = group.unit.suffix,
                                   .symbol = symbols[schema.quantities.size()],
                                   .unit = group.unit.unit,
                                   .display_scale = group.unit.display_scale,
                                   .display_unit = group.unit.display_unit,
                                   .has_standard_error = true});
      if (group.objective != nullptr) schema.quantities.back().objective = this->*group.objective;
    }
  }
  schema.quantities.push_back({.name = "science_ratio",
                               .symbol = "residual a_ng",
                               .unit = "1",
                               .display_unit = "1",
                               .objective = ratio_objective});
  return schema;
}

std::vector<Dispersion> Gradiometer::laws() const {
  std::vector<Dispersion> laws;
  for (std::size_t i = 0; i < Unknowns::count; ++i) {
    laws.push_back(normal_law(0.0, i < Unknowns::quadratic  ? matrix
                                   : i < Unknowns::coupling ? quadratic_s2_m
                                   : i < Unknowns::place    ? coupling_m
                                                            : place_m));
  }
  return laws;
}

std::vector<double> Gradiometer::truth(std::span<const double> drawn) const {
  std::vector<double> truth;
  for (const Combination& combination : combinations()) truth.push_back(combination.of(drawn));
  truth.push_back(0.0);  // A residual is best if there is none.
  return truth;
}

Gradiometer Gradiometer::reference() const {
  Gradiometer reference = *this;
  reference.duration_s = 3600.0;
  return reference;
}

Shaking::Shaking(const Gradiometer& settings)
    : settings_(settings), sampling_{FourierTransform(settings.num_samples()), 1.0} {
  SignalGroup readings{"readings", "what the accelerometers read", {}};
  for (const char* const sensor : {"1", "2", "3"}) {
    for (const std::string_view axis : axes) {
      readings.signals.push_back(
          {fmt::format("y_{}_{}", sensor, axis), "m/s²", "", fmt::format("y{} {}", sensor, axis)});
    }
  }
  recording.groups = {std::move(readings)};
  recording.sessions = {{"shaking", 1.0, settings.num_samples()}};
}

RunResult Shaking::operator()(std::uint64_t seed, RunIndex run, const RunDraw& draw,
                              const SampleSink& sink) const {
  const Measurement measurement =
      measure(settings_, sampling_, shaken(settings_, sampling_, seed, run), draw.values,
              RandomStream(seed, run, stream_id("noise")));
  for (std::size_t j = 0; sink && j < sampling_.transform.size(); ++j) {
    std::array<double, 9> values{};
    for (std::size_t i = 0; i < 9; ++i) values[i] = measurement.readings_m_s2[i / 3][j][i % 3];
    sink({.time_s = static_cast<double>(j), .values = values});
  }
  const Fit found = fit(settings_, sampling_.transform, measurement);
  RunResult result{.num_rounds = found.num_rounds};
  if (found.covariance.size() == 0) {
    result.status = RunStatus::lost;
    result.num_rounds = 0;
    result.loss = {.cause = 1, .session = 1};
    return result;
  }
  if (!found.has_converged) result.status = RunStatus::not_converged;
  const std::vector<Combination>& all = combinations();
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(all.size(), all.size());
  const double variance_factor = settings_.noise_factor * settings_.noise_factor;
  for (std::size_t a = 0; a < all.size(); ++a) {
    result.estimate.push_back(all[a].of(found.unknowns));
    for (std::size_t b = 0; b < all.size(); ++b) {
      for (const auto& [i, factor] : all[a].terms) {
        for (const auto& [j, other] : all[b].terms) {
          covariance(a, b) += variance_factor * factor * other * found.covariance(i, j);
        }
      }
    }
  }
  set_uncertainty(result, covariance);
  const ScienceRatios ratios = science_ratios(settings_, draw.values, found.unknowns, seed, run);
  result.estimate.push_back(ratios.calibrated);
  result.health = {ratios.uncalibrated, ratios.floor};
  return result;
}

const Model& built_in_model() {
  static const SettingsModel<Gradiometer> model;
  return model;
}

}  // namespace proofmass
