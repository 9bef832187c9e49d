#include "core/microscope/definition/campaign_definition.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <span>
#include <utility>

#include "core/definition/csv.hpp"
#include "core/definition/definition_text.hpp"
#include "core/definition/document.hpp"
#include "core/definition/law_reader.hpp"
#include "core/microscope/campaign/regressor_lines.hpp"
#include "core/microscope/environment/physical_environment.hpp"
#include "core/microscope/estimation/joint/joint.hpp"
#include "core/microscope/estimation/methods.hpp"
#include "core/model.hpp"
#include "core/statistics/independence.hpp"

namespace proofmass {
namespace {

// Row i of an environment table stands in line i + 1, below the headings.
DefinitionError located_in_table(const ConfigError& error, const std::string& name) {
  constexpr std::string_view row_prefix = "environment.file row ";
  std::size_t row = 0;
  if (error.field().starts_with(row_prefix)) {
    const char* const digits = error.field().data() + row_prefix.size();
    std::from_chars(digits, error.field().data() + error.field().size(), row);
  }
  return DefinitionError(fmt::format("{}:{}: {}", name, row + 1, error.what()));
}

void read_environment(MicroscopeCampaign& campaign, DataFiles& files) {
  if (campaign.scenario.environment.kind != EnvironmentKind::file) return;
  if (campaign.environment_file.empty()) return;  // validate() says what is missing.
  const std::string& text = files.text_of(campaign.environment_file, "environment.file");
  campaign.environment_table = parse_environment(text, files.name_of(campaign.environment_file),
                                                 campaign.scenario.orbit.period_s);
}

void check_environment_headings(CsvReader& reader, const std::vector<std::string_view>& headings) {
  const bool has_line = reader.next_row();
  const auto [own, expected] = std::ranges::mismatch(reader.cells(), headings);
  if (own == reader.cells().end() && expected == headings.end()) return;
  std::string text;
  if (has_line) {
    text = fmt::format(
        "column {} is {}; ", expected - headings.begin() + 1,
        own == reader.cells().end() ? "missing" : fmt::format("\"{}\"", own->substr(0, 40)));
  }
  reader.refuse(fmt::format("{}the first line must be {}", text, fmt::join(headings, ",")));
}

/// Values that a drawn quantity may have in a file.
class MagnitudeCheck {
 public:
  explicit MagnitudeCheck(std::size_t drawn)
      : path_(fmt::format("dispersion.{}", drawn_names()[drawn])),
        maximum_(drawn_magnitude_max(drawn)) {}

  void run(const Dispersion& law) const {
    check("minimum", law.minimum);
    check("maximum", law.maximum);
    check("mean", law.mean);
    check("standard_deviation", law.standard_deviation);
    check("value", law.value);
    for (const double value : law.values) check("values", value);
  }

  /// @param value  That its expression has in a run.
  void run(const Dispersion& law, RunIndex run, double value) const {
    if (is_in(value)) return;
    // The root of a negative number is none.
    const std::string drawn = std::isnan(value) ? "no number" : fmt::format("{}", value);
    throw ConfigError(path_ + ".expression", fmt::format("\"{}\"", law.expression),
                      fmt::format("run {} would draw {}, {}", run.value, drawn, rule()));
  }

  /// @param column  The values of the quantity's table, one a run.
  void run(const Dispersion& law, std::span<const double> column) const {
    const auto wrong = std::ranges::find_if(column, [&](double value) { return !is_in(value); });
    if (wrong == column.end()) return;
    throw ConfigError(path_ + ".column", fmt::format("\"{}\"", law.column),
                      fmt::format("run {} has {}, {}", wrong - column.begin(), *wrong, rule()));
  }

 private:
  [[nodiscard]] bool is_in(double value) const { return std::fabs(value) <= maximum_; }
  [[nodiscard]] std::string rule() const {
    return fmt::format("must be in [-{0:.6g}, {0:.6g}], 1000 times the nominal bound", maximum_);
  }

  void check(std::string_view key, double value) const {
    if (is_in(value)) return;
    throw ConfigError(fmt::format("{}.{}", path_, key), fmt::format("{}", value), rule());
  }

  std::string path_;
  double maximum_;
};

/// Expressions are tried with the first draws.
void check_derived(const MicroscopeCampaign& campaign) {
  constexpr std::uint64_t num_tried = 256;
  std::vector<std::size_t> derived;
  for (std::size_t i = 0; i < num_drawn; ++i) {
    if (campaign.dispersions[i].law == Law::derived) derived.push_back(i);
  }
  if (derived.empty()) return;
  for (std::uint64_t i = 0; i < num_tried && i * campaign.realisations < campaign.num_runs; ++i) {
    const RunIndex run{i * campaign.realisations};
    const DrawnValues values = draw_values(campaign.dispersions, campaign.seed, RunIndex{i}, 0,
                                           campaign.table_values(run), campaign.design);
    for (const std::size_t quantity : derived) {
      MagnitudeCheck(quantity).run(campaign.dispersions[quantity], run, values[quantity]);
    }
  }
}

void check_magnitudes(const MicroscopeCampaign& campaign) {
  for (std::size_t i = 0; i < num_drawn; ++i) MagnitudeCheck(i).run(campaign.dispersions[i]);
  const std::vector<std::size_t> drawn = campaign.table_quantities();
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    MagnitudeCheck(drawn[i]).run(campaign.dispersions[drawn[i]], campaign.table_columns[i]);
  }
  check_derived(campaign);
}

/// Lines, budget and corrections are of first order in e. Without noise the largest error of a_c13
/// is 0.5 of its objective at e = 0.2, 2.4 at 0.3 and 29 at 0.5; up to 0.1 none counts. Definitions
/// of databases may have more.
void check_orbit(const OrbitConfig& orbit) {
  constexpr double eccentricity_max = 0.1;
  if (orbit.eccentricity > eccentricity_max) {
    throw ConfigError(
        "orbit.eccentricity", fmt::format("{}", orbit.eccentricity),
        fmt::format("must be <= {}: estimates are of first order in it", eccentricity_max));
  }
  const double altitude_m = perigee_altitude_m(orbit);
  if (altitude_m >= 0.0) return;
  throw ConfigError(
      "orbit.period_s", fmt::format("{}", orbit.period_s),
      fmt::format("perigee must be above the ground, not {:.0f} km high", 1e-3 * altitude_m));
}

/// Thrusters that cannot give the commanded push leave its lines to whatever they do instead.
void check_thrust(const Scenario& scenario) {
  const double limit_m_s2 = scenario.realism ? scenario.realism->thrust_limit_m_s2 : 0.0;
  if (limit_m_s2 == 0.0) return;
  for (const Session& session : scenario.sessions) {
    for (const Excitation& excitation : session.excitations) {
      if (excitation.kind != ExcitationKind::drag_free || excitation.amplitude < limit_m_s2) {
        continue;
      }
      throw ConfigError("realism.thrust_limit_m_s2", fmt::format("{}", limit_m_s2),
                        fmt::format("must be above the {} m/s² that session {} pushes with",
                                    excitation.amplitude, session.name));
    }
  }
}

/// As a mass begins to move along X, the band-pass answers with far more than K2 makes of the
/// motion. Without noise (8 runs of the nominal campaign) that moves K2c by 6,000 s²/m after 0.3
/// decays, by 280 after 2.9, more than a quarter of its objective, and by 8 after four.
void check_filter_start(const Scenario& scenario) {
  constexpr double num_decays = 4.0;
  for (const Session& session : scenario.sessions) {
    const Product product = target_info(session.target).product;
    if (product != Product::sensor_1_squared && product != Product::sensor_2_squared) continue;
    const double least_s = num_decays * band_decay_s(scenario, session);
    if (scenario.estimation.transient_s >= least_s) continue;
    throw ConfigError(
        "estimation.transient_s", fmt::format("{}", scenario.estimation.transient_s),
        fmt::format("must be {:.0f} or more with estimation.band_ratio = {}, so that "
                    "the filter of session {} has forgotten how its mass began to "
                    "move",
                    std::ceil(least_s), scenario.estimation.band_ratio, session.name));
  }
}

/// a_d11' holds what the constant accelerations of its own session make of the quadratic factors.
/// Where a test holds another mass, that differs by up to 2 K2d b_1d = 4e-4 of the 3e-10 m/s² that
/// the loop leaves at f_EP of a test that spins: 3e-14 of δ.
void check_tests(const std::vector<Session>& sessions) {
  const auto spelling = [](DragFreeSource source) {
    return std::string(names_of(source)[static_cast<std::size_t>(source) - 1]);
  };
  const DragFreeSource calibrated = drag_free_of_a_d11_prime(sessions);
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    const Session& session = sessions[i];
    if (!is_test(session) || session.spin_rate_rad_s == 0.0) continue;
    if (session.drag_free == calibrated) continue;
    throw ConfigError(fmt::format("session[{}].drag_free", i), spelling(session.drag_free),
                      fmt::format("must be {}, as in the session of a_d11': in a test that spins, "
                                  "another constant acceleration looks like a violation",
                                  spelling(calibrated)));
  }
}

}  // namespace

EnvironmentTable parse_environment(std::string_view text, const std::string& name,
                                   double orbit_period_s) {
  CsvReader reader(text, name);
  const std::vector<std::string_view> headings = environment_table_schema().columns;
  check_environment_headings(reader, headings);
  EnvironmentTable table;
  while (reader.next_row()) {
    if (table.size() == environment_rows_max) {
      reader.refuse(fmt::format("more than {} rows", environment_rows_max));
    }
    reader.expect_cells(headings.size());
    const auto number = [&](std::size_t i) { return reader.number(i, headings[i]); };
    table.push_back({.time_s = number(0),
                     .linear_m_s2 = {number(1), number(2), number(3)},
                     .angular_rad_s2 = {number(4), number(5), number(6)}});
  }
  try {
    validate_environment_table(table, orbit_period_s);
  } catch (const ConfigError& error) {
    throw located_in_table(error, name);
  }
  return table;
}

void check_joint_campaign(const MicroscopeCampaign& campaign) {
  const Scenario& scenario = campaign.scenario;
  check_joint_records(scenario.sessions, scenario.orbit.period_s, scenario.estimation.transient_s);
  if (scenario.orbit.eccentricity > joint_eccentricity_max) {
    throw ConfigError("orbit.eccentricity", fmt::format("{}", scenario.orbit.eccentricity),
                      fmt::format("must be <= {} for estimation.method = \"joint\", which is of "
                                  "first order in it",
                                  joint_eccentricity_max));
  }
  check_joint_motions(scenario.sessions);
  check_joint_pushes(scenario.sessions,
                     push_limits(drawn_moments(campaign.dispersions),
                                 scenario.objectives[index(Parameter::a_d11_prime)]));
}

MicroscopeCampaign read_campaign(Document& document, DataFiles& files) {
  MicroscopeCampaign campaign = read_definition(document);
  document.check();
  // A file that is empty by mistake would be the nominal campaign.
  if (document.find("campaign.name") == nullptr) {
    document.refuse_absence("campaign.name", "every campaign needs one");
    document.check();
  }
  read_environment(campaign, files);
  campaign.table_columns = read_table_columns(
      law_set(campaign.dispersions), campaign, [&](const Dispersion& law, const std::string& path) {
        return parse_column(files.text_of(law.file, path + ".file"), files.name_of(law.file),
                            law.column);
      });
  try {
    campaign.validate();
    check_orbit(campaign.scenario.orbit);
    check_thrust(campaign.scenario);
    check_tests(campaign.scenario.sessions);
    check_magnitudes(campaign);
    check_independence(law_set(campaign.dispersions), campaign);
    if (estimation_method(campaign.scenario.estimation.method).name == joint_method.name) {
      check_joint_campaign(campaign);
    } else {
      check_regressors(campaign.scenario);
      check_filter_start(campaign.scenario);
    }
  } catch (const ConfigError& error) {
    throw document.located(error);
  }
  return campaign;
}

namespace {

/// Without the limits of health that definitions had up to the model hardy2013-3. Results under
/// them are stored and can be read; no run is computed under them any more.
std::string without_former_limits(std::string text) {
  constexpr std::string_view table = "\n[health]\n";
  const std::size_t begin = text.find(table);
  if (begin == std::string::npos) return text;
  std::size_t end = begin + table.size();
  for (const std::string_view key : {"attitude_max_rad = ", "residual_max_m_s2 = ",
                                     "quadratic_noise_max = ", "square_noise_max = "}) {
    const std::size_t line_end = text.find('\n', end);
    if (text.compare(end, key.size(), key) != 0 || line_end == std::string::npos) return text;
    end = line_end + 1;
  }
  return text.erase(begin + 1, end - begin - 1);
}

/// The first line where the texts differ, of each.
void require_same_text(std::string_view source, std::string_view text, std::string_view canonical) {
  const auto [found, expected] = std::ranges::mismatch(text, canonical);
  if (found == text.end() && expected == canonical.end()) return;
  const auto position = static_cast<std::size_t>(found - text.begin());
  const std::size_t line_begin = canonical.substr(0, position).rfind('\n') + 1;
  const auto line_of = [&](std::string_view whole) {
    const std::string_view rest = whole.substr(line_begin);
    return detail::quoted_text(rest.substr(0, rest.find('\n')).substr(0, 100));
  };
  throw DefinitionError(
      fmt::format("{}:{}: line = {} (must be {}, as the definition has one spelling)", source,
                  1 + std::ranges::count(canonical.substr(0, line_begin), '\n'), line_of(text),
                  line_of(canonical)));
}

}  // namespace

Definition definition_of(const MicroscopeCampaign& campaign, TableColumns columns) {
  const Model& model = campaign.model();
  Definition definition{.text = canonical_definition(campaign),
                        .tables = tables_of(campaign.environment_table),
                        .table_columns = {}};
  if (columns == TableColumns::included) definition.table_columns = campaign.table_columns;
  if (&model != &built_in_model()) definition.model = model.version();
  return definition;
}

Scenario recorded_scenario(std::string_view text) {
  // What every program asks for as it starts, for the examples in its help.
  if (text.empty()) return hardy2013_campaign().scenario;
  try {
    Document document("definition", text, {});
    Scenario scenario = read_definition(document).scenario;
    validate_sessions(scenario.sessions, scenario.orbit.period_s,
                      scenario.simulation.sample_period_s);
    return scenario;
  } catch (const Error&) {
    return hardy2013_campaign().scenario;
  }
}

MicroscopeCampaign campaign_of(Definition definition, TableColumns columns,
                               std::string_view source) {
  check_columns(definition, columns);
  EnvironmentTable environment_table = environment_of(definition.tables);
  const std::string text = without_former_limits(std::move(definition.text));
  Document document(std::string(source), text, {});
  MicroscopeCampaign campaign = read_definition(document);
  document.check();
  campaign.environment_table = std::move(environment_table);
  campaign.table_columns = std::move(definition.table_columns);
  try {
    campaign.validate(columns);
  } catch (const ConfigError& error) {
    throw document.located(error);
  }
  require_same_text(source, text, canonical_definition(campaign));
  return campaign;
}

}  // namespace proofmass
