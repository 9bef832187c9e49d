#include "core/microscope/estimation/methods.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <span>
#include <string>

#include "core/error.hpp"
#include "core/microscope/estimation/hardy2013/hardy2013.hpp"
#include "core/microscope/estimation/joint/joint.hpp"

namespace proofmass {
namespace {

// Positions are sent and stored: add at the end.
constexpr std::array methods{
    hardy2013_method,
    joint_method,
};

constexpr std::array<std::string_view, methods.size()> method_names = [] {
  std::array<std::string_view, methods.size()> names{};
  for (std::size_t i = 0; i < methods.size(); ++i) names[i] = methods[i].name;
  return names;
}();

// The densities that the weights are made of are within 0.15 dB of those of the noise filters.
constexpr double fit_tolerance = 0.035;

std::string in_small_letters(std::string text) {
  for (char& letter : text) {
    if (letter >= 'A' && letter <= 'Z') letter = static_cast<char>(letter - 'A' + 'a');
  }
  return text;
}

}  // namespace

const EstimationMethodInfo& estimation_method(EstimationMethod method) {
  const auto position = static_cast<std::size_t>(method) - 1;
  PROOFMASS_EXPECT(position < methods.size());
  return methods[position];
}

std::span<const EstimationMethodInfo> estimation_methods() { return methods; }

double band_centre_hz(const Session& session, double orbit_period_s) {
  double centre_hz = 0.0;
  for (const LineMultiple& line : session.fit_lines) {
    centre_hz += line_frequency_hz(session, line, orbit_period_s) /
                 static_cast<double>(session.fit_lines.size());
  }
  return centre_hz;
}

BandPass fit_lines_filter(const Session& session, const EstimationConfig& config,
                          double orbit_period_s, double sample_period_s) {
  const double centre_hz = band_centre_hz(session, orbit_period_s);
  return band_pass(centre_hz / config.band_ratio, centre_hz * config.band_ratio, sample_period_s);
}

BandPass further_lines_filter(const RecordNeeds& needs, const Session& session,
                              const EstimationConfig& config, double orbit_period_s,
                              double sample_period_s) {
  double highest_hz = 0.0;
  const auto add = [&](const LineMultiple& line) {
    highest_hz = std::max(highest_hz, line_frequency_hz(session, line, orbit_period_s));
  };
  for (const WantedLine& wanted : needs.lines) add(wanted.line);
  for (const LineMultiple& neighbour : needs.neighbours) add(neighbour);
  const double corner_hz = std::min(config.band_ratio * highest_hz, 0.25 / sample_period_s);
  return {no_filter.high_pass, butterworth_low_pass(corner_hz, sample_period_s)};
}

ResultSchema results_with_errors() {
  ResultSchema schema = microscope_results();
  for (Quantity& quantity : schema.quantities) quantity.has_standard_error = true;
  schema.fit = {{"chi_squared", "", "1"}, {"degrees_of_freedom", "", "1"}};
  schema.fit_tolerance = fit_tolerance;
  return schema;
}

bool is_beyond_chance(double chi_squared, double degrees_of_freedom) {
  // χ² ≥ ν + 2√(νx) + 2x with a chance of e⁻ˣ at most [LaurentMassart2000].
  constexpr double x = 13.9;  // e⁻ˣ < 1e-6.
  const double bound = degrees_of_freedom + 2.0 * std::sqrt(degrees_of_freedom * x) + 2.0 * x;
  return chi_squared > (1.0 + fit_tolerance) * bound;
}

void add_session_fits(const std::vector<Session>& sessions, ResultSchema& schema) {
  std::set<std::string> taken;
  for (const Session& session : sessions) {
    // Names of sessions may differ in case alone, and names of columns may not.
    std::string name = session.name;
    while (!taken.insert(in_small_letters(name)).second) name += '_';
    schema.fit_parts.push_back(session.name);
    schema.fit.push_back({"chi_squared_" + name, "", "1"});
    schema.fit.push_back({"degrees_of_freedom_" + name, "", "1"});
  }
}

std::span<const std::string_view> names_of(Correction) {
  static constexpr std::array<std::string_view, 3> names{"first_order", "second_order",
                                                         "hardy2013"};
  return names;
}

std::span<const std::string_view> names_of(EstimationMethod) { return method_names; }

}  // namespace proofmass
