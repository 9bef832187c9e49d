#include <Eigen/Dense>

#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/instrument/instrument.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

constexpr std::uint64_t seed = 99;
constexpr std::size_t num_runs = 20'000;

Dispersion uniform_law(double minimum, double maximum) {
  Dispersion law;
  law.minimum = minimum;
  law.maximum = maximum;
  return law;
}

Dispersion normal_law(double mean, double standard_deviation) {
  Dispersion law;
  law.law = Law::normal;
  law.mean = mean;
  law.standard_deviation = standard_deviation;
  return law;
}

Dispersion truncated(Dispersion law, double minimum, double maximum) {
  law.law = Law::truncated_normal;
  law.minimum = minimum;
  law.maximum = maximum;
  return law;
}

/// A law for each of the first five elements, a table for the last, the nominal ones for the
/// others.
DispersionSet mixed_laws() {
  DispersionSet laws = nominal_dispersions();
  laws[0] = uniform_law(-2.0, 6.0);
  laws[1] = normal_law(3.0, 0.5);
  laws[2] = truncated(normal_law(1.0, 2.0), 0.5, 3.0);
  laws[3].law = Law::fixed;
  laws[3].value = -7.25;
  laws[4].law = laws[59].law = Law::table;
  return laws;
}

/// The element's values over all runs of a campaign.
std::vector<double> values_of(std::size_t element) {
  const DispersionSet laws = mixed_laws();
  const std::vector<double> table_values{1.0, 2.0};
  std::vector<double> values;
  for (std::uint64_t run = 0; run < num_runs; ++run) {
    values.push_back(draw_values(laws, seed, RunIndex{run}, 0, table_values)[element]);
  }
  return values;
}

/// Largest distance between the empirical distribution of values and F.
double kolmogorov_smirnov(std::vector<double> values, const std::function<double(double)>& law) {
  std::sort(values.begin(), values.end());
  const auto n = static_cast<double>(values.size());
  double distance = 0.0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double p = law(values[i]);
    const auto below = static_cast<double>(i);
    distance = std::fmax(distance, std::fmax(p - below / n, (below + 1.0) / n - p));
  }
  return distance;
}

// P(√n D > x) → 2 e^(−2x²) [Kolmogorov1933]; 2.69 is exceeded once in a million.
const double critical_distance = 2.69 / std::sqrt(static_cast<double>(num_runs));

double normal_distribution(double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); }

TEST(DrawValues, FollowAUniformLaw) {
  const double distance =
      kolmogorov_smirnov(values_of(0), [](double x) { return (x + 2.0) / 8.0; });
  EXPECT_LT(distance, critical_distance);
}

TEST(DrawValues, FollowANormalLaw) {
  const double distance = kolmogorov_smirnov(
      values_of(1), [](double x) { return normal_distribution((x - 3.0) / 0.5); });
  EXPECT_LT(distance, critical_distance);
}

TEST(DrawValues, FollowATruncatedNormalLaw) {
  const std::vector<double> values = values_of(2);
  EXPECT_GE(*std::min_element(values.begin(), values.end()), 0.5);
  EXPECT_LE(*std::max_element(values.begin(), values.end()), 3.0);
  const double low = normal_distribution(-0.25);
  const double high = normal_distribution(1.0);
  const double distance = kolmogorov_smirnov(values, [low, high](double x) {
    return (normal_distribution((x - 1.0) / 2.0) - low) / (high - low);
  });
  EXPECT_LT(distance, critical_distance);
}

TEST(DrawValues, TakeFixedAndTabulatedValuesAsTheyAre) {
  const std::vector<double> table_values{0.125, -8.0};
  const DrawnValues values = draw_values(mixed_laws(), seed, RunIndex{5}, 0, table_values);
  EXPECT_EQ(values[3], -7.25);
  EXPECT_EQ(values[4], 0.125);
  EXPECT_EQ(values[59], -8.0);
}

// Sixty streams of 20,000 uniform numbers: all pairs' correlations within 5.5 standard errors 1/√n,
// which one of 1770 exceeds once in 15,000 seeds.
TEST(DrawValues, OfDifferentElementsAreUncorrelated) {
  const DispersionSet laws = nominal_dispersions();
  Eigen::MatrixXd values(static_cast<Eigen::Index>(num_runs), static_cast<Eigen::Index>(num_drawn));
  for (std::uint64_t run = 0; run < num_runs; ++run) {
    const DrawnValues drawn = draw_values(laws, seed, RunIndex{run}, 0, {});
    for (std::size_t i = 0; i < num_drawn; ++i) {
      values(static_cast<Eigen::Index>(run), static_cast<Eigen::Index>(i)) =
          drawn[i] / laws[i].maximum * std::numbers::sqrt3;  // Unit variance.
    }
  }
  Eigen::MatrixXd correlation = values.transpose() * values / static_cast<double>(num_runs);
  // E x⁴ − 1 = 9/5 − 1: the variances have the standard error √(0.8/n).
  correlation.diagonal().array() -= 1.0;
  EXPECT_LT(correlation.cwiseAbs().maxCoeff(), 5.5 / std::sqrt(static_cast<double>(num_runs)));
}

TEST(DrawValues, OfOneElementDoNotDependOnTheLawsOfOthers) {
  const DrawnValues nominal = draw_values(nominal_dispersions(), seed, RunIndex{17}, 3, {});
  const std::vector<double> table_values{1.0, 2.0};
  const DrawnValues mixed = draw_values(mixed_laws(), seed, RunIndex{17}, 3, table_values);
  for (std::size_t i = 5; i < 59; ++i) EXPECT_EQ(mixed[i], nominal[i]) << drawn_names()[i];
}

TEST(DrawValues, DifferWithSeedRunAndDraw) {
  const DispersionSet laws = nominal_dispersions();
  const DrawnValues values = draw_values(laws, seed, RunIndex{17}, 0, {});
  EXPECT_EQ(draw_values(laws, seed, RunIndex{17}, 0, {}), values);
  for (std::size_t i = 0; i < num_drawn; ++i) {
    if (laws[i].law == Law::fixed) continue;
    EXPECT_NE(draw_values(laws, seed + 1, RunIndex{17}, 0, {})[i], values[i]);
    EXPECT_NE(draw_values(laws, seed, RunIndex{18}, 0, {})[i], values[i]);
    EXPECT_NE(draw_values(laws, seed, RunIndex{17}, 1, {})[i], values[i]);
  }
}

// A law at the edge of what validation accepts: the mean on a bound, a sliver 1/100 σ wide, which
// one block in 250 hits.
TEST(DrawValues, FollowATruncatedNormalLawOnASliver) {
  DispersionSet laws = nominal_dispersions();
  laws[0] = truncated(normal_law(0.0, 1.0), 0.0, 0.01);
  std::vector<double> values;
  for (std::uint64_t run = 0; run < 2000; ++run) {
    values.push_back(draw_values(laws, seed, RunIndex{run}, 0, {})[0]);
  }
  const double distance = kolmogorov_smirnov(values, [](double x) { return x / 0.01; });
  EXPECT_LT(distance, 2.69 / std::sqrt(2000.0));
}

/// Whether the bounds of [Hardy2013] hold for the sensitivity matrices of both sensors.
bool accepts(const Eigen::Matrix3d& m1, const Eigen::Matrix3d& m2) {
  const Eigen::Matrix3d common = 0.5 * (m1 + m2);
  const Eigen::Matrix3d a_d = 0.5 * (m1 - m2) * common.inverse();
  const Eigen::Matrix3d a_c = common - 0.5 * a_d * (m1 - m2);
  return std::abs(a_d(0, 0)) <= 1e-2 && std::abs(a_d(0, 1)) <= 1.6e-3 &&
         std::abs(a_d(0, 2)) <= 1.6e-3 && std::abs(a_c(0, 1)) <= 2.6e-3 &&
         std::abs(a_c(0, 2)) <= 2.6e-3;
}

TEST(DrawInstrument, KeepsTheBounds) {
  const MicroscopeCampaign campaign;
  for (std::uint64_t run = 0; run < 5000; ++run) {
    const AcceptedDraw draw = draw_instrument(campaign, RunIndex{run}, {});
    ASSERT_TRUE(draw.instrument.has_value());
    ASSERT_TRUE(accepts(draw.instrument->sensors[0].sensitivity_KS(),
                        draw.instrument->sensors[1].sensitivity_KS()));
  }
}

// The draws before the accepted one are rejected ones, and the accepted one is the draw of its
// number.
TEST(DrawInstrument, TakesTheFirstDrawThatIsAccepted) {
  const MicroscopeCampaign campaign;
  int num_redrawn = 0;
  for (std::uint64_t run = 0; run < 200; ++run) {
    const AcceptedDraw draw = draw_instrument(campaign, RunIndex{run}, {});
    for (std::uint32_t i = 0; i < draw.num_draws; ++i) {
      const Instrument instrument =
          make_instrument(draw_values(campaign.dispersions, campaign.seed, RunIndex{run}, i, {}));
      const bool is_last = i + 1 == draw.num_draws;
      ASSERT_EQ(is_accepted(instrument, campaign.scenario.acceptance), is_last);
      if (!is_last) continue;
      EXPECT_EQ(instrument.offcentring_S_m, draw.instrument->offcentring_S_m);
    }
    if (draw.num_draws > 1) ++num_redrawn;
  }
  EXPECT_GT(num_redrawn, 20);
}

// One bound at a time, just below and just above the value it bounds.
TEST(IsAccepted, ComparesEachEntryWithItsBound) {
  const MicroscopeCampaign campaign;
  const Instrument instrument =
      make_instrument(draw_values(campaign.dispersions, campaign.seed, RunIndex{0}, 0, {}));
  const Eigen::Matrix3d m1 = instrument.sensors[0].sensitivity_KS();
  const Eigen::Matrix3d m2 = instrument.sensors[1].sensitivity_KS();
  const Eigen::Matrix3d a_d = (m1 - m2) * (m1 + m2).inverse();
  const Eigen::Matrix3d a_c = 0.5 * (m1 + m2) - 0.5 * a_d * (m1 - m2);
  const double differential = std::fmax(std::abs(a_d(0, 1)), std::abs(a_d(0, 2)));
  const double common = std::fmax(std::abs(a_c(0, 1)), std::abs(a_c(0, 2)));
  const double scale = std::abs(a_d(0, 0));
  EXPECT_TRUE(is_accepted(instrument, {1.001 * scale, 1.001 * differential, 1.001 * common}));
  EXPECT_FALSE(is_accepted(instrument, {0.999 * scale, 1.001 * differential, 1.001 * common}));
  EXPECT_FALSE(is_accepted(instrument, {1.001 * scale, 0.999 * differential, 1.001 * common}));
  EXPECT_FALSE(is_accepted(instrument, {1.001 * scale, 1.001 * differential, 0.999 * common}));
}

TEST(DrawInstrument, GivesUpAfterAThousandDraws) {
  MicroscopeCampaign campaign;
  campaign.scenario.acceptance.a_d11_max = 1e-30;
  const AcceptedDraw draw = draw_instrument(campaign, RunIndex{0}, {});
  EXPECT_FALSE(draw.instrument.has_value());
  EXPECT_EQ(draw.num_draws, num_draws_max);
}

TEST(DrawInstrument, DrawsAgainIfAnExpressionHasNoValueInRange) {
  MicroscopeCampaign campaign = hardy2013_campaign();
  const auto index = [](std::string_view name) {
    return static_cast<std::size_t>(std::ranges::find(drawn_names(), name) - drawn_names().begin());
  };
  Dispersion& law = campaign.dispersions[index("offcentring_m.x")];
  law = {
      .law = Law::derived, .file = {}, .column = {}, .expression = "sqrt(offcentring_m.y) / 1e3"};
  // The square root of half of the draws is none, so that the number of draws is geometric.
  constexpr std::uint64_t num_instruments = 2000;
  double num_draws = 0.0;
  for (std::uint64_t run = 0; run < num_instruments; ++run) {
    const AcceptedDraw draw = draw_instrument(campaign, RunIndex{run}, {});
    ASSERT_TRUE(draw.instrument);
    EXPECT_GE(draw.values[index("offcentring_m.y")], 0.0);
    num_draws += draw.num_draws;
  }
  law.law = Law::fixed;
  double num_accepted_alone = 0.0;
  for (std::uint64_t run = 0; run < num_instruments; ++run) {
    num_accepted_alone += draw_instrument(campaign, RunIndex{run}, {}).num_draws;
  }
  const double ratio = num_draws / num_accepted_alone;
  const double standard_error = std::sqrt(2.0 / num_instruments);  // Of a geometric law with ½.
  EXPECT_NEAR(ratio, 2.0, 5.0 * standard_error);
  law = {.law = Law::derived, .file = {}, .column = {}, .expression = "offcentring_m.y / 0"};
  EXPECT_FALSE(draw_instrument(campaign, RunIndex{0}, {}).instrument);
}

}  // namespace
}  // namespace proofmass
