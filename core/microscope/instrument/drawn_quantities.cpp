#include "core/microscope/instrument/drawn_quantities.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include "core/campaign/expression.hpp"
#include "core/error.hpp"
#include "core/microscope/instrument/magnitude.hpp"

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
  dispersions[index_of_eotvos_parameter] = {.law = Law::fixed, .file = {}, .column = {}};
  return dispersions;
}

std::vector<std::size_t> table_elements(const DispersionSet& dispersions) {
  std::vector<std::size_t> elements;
  for (std::size_t i = 0; i < dispersions.size(); ++i) {
    if (dispersions[i].law == Law::table) elements.push_back(i);
  }
  return elements;
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

namespace {

std::size_t index_of(std::string_view name) {
  return static_cast<std::size_t>(std::ranges::find(drawn_names(), name) - drawn_names().begin());
}

/// The lower triangular L with L Lᵀ the correlations of all quantities that have some, in their
/// order. A quantity correlates with earlier ones, so that the deviates of those before it do not
/// depend on its law.
struct CorrelationFactor {
  std::vector<std::size_t> quantities;
  std::vector<std::vector<double>> rows;
  /// The first quantity with which the correlations are no longer positive definite.
  std::optional<std::size_t> not_definite = {};
};

double product_of(std::span<const double> first, std::span<const double> second) {
  return std::inner_product(first.begin(), first.end(), second.begin(), 0.0);
}

CorrelationFactor correlation_factor(const DispersionSet& dispersions) {
  std::set<std::size_t> involved;
  for (std::size_t i = 0; i < num_drawn; ++i) {
    if (dispersions[i].law != Law::correlated) continue;
    involved.insert(i);
    for (const std::string& name : dispersions[i].with) involved.insert(index_of(name));
  }
  CorrelationFactor factor{.quantities = {involved.begin(), involved.end()}, .rows = {}};
  for (const std::size_t quantity : factor.quantities) {
    const Dispersion& law = dispersions[quantity];
    std::vector<double> row;
    for (const std::vector<double>& before : factor.rows) {
      const std::string& name = drawn_names()[factor.quantities[row.size()]];
      const auto found = std::ranges::find(law.with, name);
      const bool is_given = law.law == Law::correlated && found != law.with.end();
      const double correlation =
          is_given ? law.correlations[static_cast<std::size_t>(found - law.with.begin())] : 0.0;
      row.push_back((correlation - product_of(row, before)) / before.back());
    }
    const double rest = 1.0 - product_of(row, row);
    constexpr double rest_min = 1e-9;  // Below it nothing but rounding may be left.
    if (!(rest > rest_min)) {
      factor.not_definite = quantity;
      return factor;
    }
    row.push_back(std::sqrt(rest));
    factor.rows.push_back(std::move(row));
  }
  return factor;
}

Stratum stratum_in(const SamplingDesign& design, std::size_t quantity, std::uint64_t seed,
                   RunIndex run, std::uint32_t draw) {
  return draw == 0 ? stratum_of(design, quantity, seed, run) : Stratum{};
}

/// Replaces the values of quantities with the law `correlated`.
void correlate(const DispersionSet& dispersions, std::uint64_t seed, RunIndex run,
               std::uint32_t draw, const SamplingDesign& design, DrawnValues& values) {
  const CorrelationFactor factor = correlation_factor(dispersions);
  std::vector<double> deviates;
  for (std::size_t i = 0; i < factor.rows.size(); ++i) {
    const std::size_t quantity = factor.quantities[i];
    const Dispersion& law = dispersions[quantity];
    deviates.push_back(draw_deviate(drawn_names()[quantity], seed, run, draw,
                                    stratum_in(design, quantity, seed, run, draw)));
    if (law.law != Law::correlated) continue;
    values[quantity] = law.mean + law.standard_deviation * product_of(factor.rows[i], deviates);
  }
}

/// Computes values of the law `derived`, each after those that it needs.
class Derivation {
 public:
  Derivation(const DispersionSet& dispersions, DrawnValues& values)
      : dispersions_(dispersions), values_(values) {}

  double value_of(std::size_t quantity) {
    if (dispersions_[quantity].law != Law::derived || is_known_[quantity]) return values_[quantity];
    values_[quantity] =
        evaluate_expression(dispersions_[quantity].expression,
                            [this](std::string_view name) { return value_of(index_of(name)); });
    is_known_[quantity] = true;
    return values_[quantity];
  }

 private:
  const DispersionSet& dispersions_;
  DrawnValues& values_;
  std::array<bool, num_drawn> is_known_{};
};

/// Follows the names in expressions, each quantity once.
class ExpressionCheck {
 public:
  explicit ExpressionCheck(const DispersionSet& dispersions) : dispersions_(dispersions) {}

  void run(std::size_t quantity) {
    if (dispersions_[quantity].law != Law::derived || states_[quantity] == State::sound) return;
    states_[quantity] = State::open;
    const std::string path = fmt::format("dispersion.{}.expression", drawn_names()[quantity]);
    const std::string value = fmt::format("\"{}\"", dispersions_[quantity].expression);
    const auto follow = [&](std::string_view name) {
      const std::size_t next = index_of(name);
      if (next == num_drawn) {
        throw ConfigError(path, value, fmt::format("{} is no drawn quantity", name));
      }
      if (states_[next] == State::open) {
        throw ConfigError(path, value, fmt::format("{} depends on it in turn", name));
      }
      run(next);
      return 1.0;
    };
    try {
      (void)evaluate_expression(dispersions_[quantity].expression, follow);
    } catch (const InvalidArgument& error) {
      throw ConfigError(path, value, error.what());
    }
    states_[quantity] = State::sound;
  }

 private:
  enum class State : std::uint8_t { unknown, open, sound };
  const DispersionSet& dispersions_;
  std::array<State, num_drawn> states_{};
};

void check_partners(const DispersionSet& dispersions, std::size_t quantity) {
  const Dispersion& law = dispersions[quantity];
  const auto refuse = [&](std::string_view name, std::string_view rule) {
    throw ConfigError(fmt::format("dispersion.{}.with", drawn_names()[quantity]),
                      fmt::format("\"{}\"", name), rule);
  };
  std::set<std::string> seen;
  for (const std::string& name : law.with) {
    const std::size_t other = index_of(name);
    if (other == num_drawn) refuse(name, "is no drawn quantity");
    if (other >= quantity) refuse(name, "must come before it in the order of drawn quantities");
    if (!seen.insert(name).second) refuse(name, "is there twice");
    const Law of_other = dispersions[other].law;
    if (of_other != Law::normal && of_other != Law::correlated) {
      refuse(name, "must have the law normal or correlated");
    }
  }
}

}  // namespace

void check_relations(const DispersionSet& dispersions) {
  ExpressionCheck expressions(dispersions);
  for (std::size_t i = 0; i < num_drawn; ++i) {
    expressions.run(i);
    if (dispersions[i].law == Law::correlated) check_partners(dispersions, i);
  }
  if (const auto quantity = correlation_factor(dispersions).not_definite) {
    throw ConfigError(fmt::format("dispersion.{}.correlations", drawn_names()[*quantity]),
                      fmt::format("[{}]", fmt::join(dispersions[*quantity].correlations, ", ")),
                      "with those before it, the correlations must be positive definite");
  }
}

double drawn_magnitude_max(std::size_t quantity) {
  const auto after = std::ranges::upper_bound(draw_groups(), quantity, {}, &DrawGroup::first);
  return 1000.0 * std::prev(after)->bound;
}

DrawnValues draw_values(const DispersionSet& dispersions, std::uint64_t seed, RunIndex run,
                        std::uint32_t draw, std::span<const double> table_values,
                        const SamplingDesign& design) {
  DrawnValues values{};
  std::size_t next_table_value = 0;
  bool is_related = false;
  for (std::size_t i = 0; i < num_drawn; ++i) {
    const Law law = dispersions[i].law;
    if (law == Law::derived || law == Law::correlated) {
      is_related = true;
      continue;
    }
    const bool is_of_table = law == Law::table;
    PROOFMASS_EXPECT(!is_of_table || next_table_value < table_values.size());
    const double table_value = is_of_table ? table_values[next_table_value++] : 0.0;
    values[i] = draw_value(dispersions[i], drawn_names()[i], seed, run, draw, table_value,
                           stratum_in(design, i, seed, run, draw));
  }
  if (!is_related) return values;
  correlate(dispersions, seed, run, draw, design, values);
  Derivation derivation(dispersions, values);
  for (std::size_t i = 0; i < num_drawn; ++i) (void)derivation.value_of(i);
  return values;
}

}  // namespace proofmass
