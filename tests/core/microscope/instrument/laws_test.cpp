#include <Eigen/Dense>

#include "core/error.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/instrument/drawn_moments.hpp"
#include "core/random/stream.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

constexpr std::uint64_t seed = 41;
constexpr std::uint64_t num_runs = 20'000;

double normal_distribution(double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); }

Dispersion normal_law(Law law, double mean, double standard_deviation) {
  Dispersion normal;
  normal.law = law;
  normal.mean = mean;
  normal.standard_deviation = standard_deviation;
  return normal;
}

Dispersion derived(std::string expression) {
  Dispersion law;
  law.law = Law::derived;
  law.expression = std::move(expression);
  return law;
}

Dispersion correlated(double mean, double deviation, std::vector<std::string> with,
                      std::vector<double> correlations) {
  Dispersion law = normal_law(Law::correlated, mean, deviation);
  law.with = std::move(with);
  law.correlations = std::move(correlations);
  return law;
}

DrawnValues draw(const DispersionSet& laws, std::uint64_t run, std::uint32_t number = 0) {
  return draw_values(laws, seed, RunIndex{run}, number, {});
}

std::string refusal_of(const DispersionSet& laws) {
  MicroscopeCampaign campaign;
  campaign.dispersions = laws;
  return test::message_of<ConfigError>([&] { campaign.validate(); });
}

// Shares of 20,000 draws within five standard errors.
TEST(DiscreteLaw, HasEachValueWithItsProbability) {
  DispersionSet laws = nominal_dispersions();
  laws[3].law = Law::discrete;
  laws[3].values = {5.0, -1.0, 2.0};
  laws[3].probabilities = {0.5, 0.0, 0.5};
  laws[4].law = Law::discrete;
  laws[4].values = {0.0, 1.0};
  laws[4].probabilities = {0.9, 0.1};
  double fives = 0.0, ones = 0.0;
  for (std::uint64_t run = 0; run < num_runs; ++run) {
    const DrawnValues values = draw(laws, run);
    ASSERT_TRUE(values[3] == 5.0 || values[3] == 2.0);
    fives += values[3] == 5.0 ? 1.0 : 0.0;
    ones += values[4];
  }
  EXPECT_NEAR(fives / num_runs, 0.5, 5.0 * std::sqrt(0.25 / num_runs));
  EXPECT_NEAR(ones / num_runs, 0.1, 5.0 * std::sqrt(0.09 / num_runs));
}

// Kolmogorov's distance exceeds 2.69/√n once in a million.
void expect_truncated(double mean, double deviation, double minimum, double maximum) {
  DispersionSet laws = nominal_dispersions();
  laws[0] = normal_law(Law::truncated, mean, deviation);
  laws[0].minimum = minimum;
  laws[0].maximum = maximum;
  ASSERT_EQ(refusal_of(laws), "");
  std::vector<double> values;
  for (std::uint64_t run = 0; run < num_runs; ++run) values.push_back(draw(laws, run)[0]);
  std::ranges::sort(values);
  EXPECT_GE(values.front(), minimum);
  EXPECT_LE(values.back(), maximum);
  // In the lower half, where differences of probabilities keep their digits.
  const double sign = minimum > mean ? -1.0 : 1.0;
  const auto below = [&](double x) { return normal_distribution(sign * (x - mean) / deviation); };
  double distance = 0.0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double p = (below(values[i]) - below(minimum)) / (below(maximum) - below(minimum));
    const auto rank = static_cast<double>(i);
    distance = std::fmax(distance, std::fmax(p - rank / num_runs, (rank + 1.0) / num_runs - p));
  }
  EXPECT_LT(distance, 2.69 / std::sqrt(static_cast<double>(num_runs)));
}

TEST(TruncatedLaw, FollowsTheNormalLawBetweenItsBounds) {
  expect_truncated(1.0, 2.0, 0.5, 3.0);
  expect_truncated(0.0, 1.0, -8.0, 8.0);
  expect_truncated(0.0, 1.0, 6.0, 7.0);
  expect_truncated(0.0, 1.0, -20.0, -19.5);
}

TEST(DerivedLaw, IsAFunctionOfOtherQuantities) {
  DispersionSet laws = nominal_dispersions();
  laws[0] = derived("2 * scale_factor_error.sensor_1_y + 1e-3");
  laws[1] = derived("pow(offcentring_m.z, 2) - read_out_bias_m_s2.sensor_1_x");
  for (std::uint64_t run = 0; run < 50; ++run) {
    const DrawnValues plain = draw(nominal_dispersions(), run);
    const DrawnValues values = draw(laws, run);
    EXPECT_EQ(values[1], plain[26] * plain[26] - plain[30]);
    EXPECT_EQ(values[0], 2.0 * values[1] + 1e-3);
    for (std::size_t i = 2; i < num_drawn; ++i) EXPECT_EQ(values[i], plain[i]);
  }
}

TEST(DerivedLaw, RefusesWhatIsNoFunctionOfOthers) {
  DispersionSet laws = nominal_dispersions();
  laws[1] = derived("2 * offcentring_m.q");
  EXPECT_EQ(refusal_of(laws),
            "dispersion.scale_factor_error.sensor_1_y.expression = \"2 * offcentring_m.q\" "
            "(offcentring_m.q is no drawn quantity; the functions are sqrt(x) and pow(x, n))");
  laws[1] = derived("1 +");
  EXPECT_EQ(refusal_of(laws),
            "dispersion.scale_factor_error.sensor_1_y.expression = \"1 +\" (character 4 must be a "
            "number, a quantity, sqrt, pow, - or ()");
  laws[1] = derived("-scale_factor_error.sensor_1_z");
  laws[2] = derived("1 + scale_factor_error.sensor_1_y");
  EXPECT_EQ(
      refusal_of(laws),
      "dispersion.scale_factor_error.sensor_1_z.expression = \"1 + "
      "scale_factor_error.sensor_1_y\" (scale_factor_error.sensor_1_y depends on it in turn)");
  laws[1] = derived(std::string(1025, ' '));
  EXPECT_EQ(refusal_of(laws),
            "dispersion.scale_factor_error.sensor_1_y.expression = 1025 bytes (must be at most "
            "1024)");
}

// Every quantity but the first follows from the one before it, by expressions as deep as they may
// be: the deepest that evaluation becomes.
TEST(DerivedLaw, MayBeAChainOfAllQuantities) {
  DispersionSet laws = nominal_dispersions();
  for (std::size_t i = 1; i < num_drawn; ++i) {
    laws[i] = derived(std::string(30, '(') + "2 * " + drawn_names()[i - 1] + std::string(30, ')'));
  }
  ASSERT_EQ(refusal_of(laws), "");
  const DrawnValues values = draw(laws, 7);
  for (std::size_t i = 0; i < num_drawn; ++i) {
    EXPECT_EQ(values[i], std::ldexp(values[0], static_cast<int>(i)));
  }
  laws[0] = derived(drawn_names()[num_drawn - 1]);
  EXPECT_EQ(refusal_of(laws), "dispersion.scale_factor_error.sensor_1_y.expression = \"" +
                                  laws[1].expression +
                                  "\" (scale_factor_error.sensor_1_x depends on it in turn)");
}

double deviation_of(const DrawnMoments& moments, std::size_t quantity) {
  return std::sqrt(moments.covariance.diagonal()[static_cast<Eigen::Index>(quantity)]);
}

// x is uniform on ±b: x² has the mean b²/3 and the variance 4 b⁴/45, and no correlation with x; 3 x
// has three times the deviation of x. Five standard errors of 8192 draws, √((κ − 1)/4n) of a
// deviation with κ = 1.8 for x and 2.14 for x².
TEST(DrawnMoments, OfDerivedQuantitiesAreThoseOfTheirFunction) {
  DispersionSet laws = nominal_dispersions();
  laws[24].law = Law::table;  // Counts as nominal, on ±b.
  laws[25] = derived("pow(offcentring_m.x, 2)");
  laws[26] = derived("3 * offcentring_m.x");
  const double b = nominal_dispersions()[24].maximum, n = 8192.0;
  const DrawnMoments moments = drawn_moments(laws);
  EXPECT_EQ(moments.mean[24], 0.0);
  EXPECT_DOUBLE_EQ(deviation_of(moments, 24), b / std::sqrt(3.0));
  const double of_square = b * b * std::sqrt(4.0 / 45.0);
  EXPECT_NEAR(moments.mean[25], b * b / 3.0, 5.0 * of_square / std::sqrt(n));
  EXPECT_NEAR(deviation_of(moments, 25) / of_square, 1.0, 5.0 * std::sqrt(1.14 / (4.0 * n)));
  EXPECT_NEAR(deviation_of(moments, 26) / (3.0 * b / std::sqrt(3.0)), 1.0,
              5.0 * std::sqrt(0.8 / (4.0 * n)));
  const auto correlation = [&](Eigen::Index i, Eigen::Index j) {
    return moments.covariance(i, j) /
           std::sqrt(moments.covariance(i, i) * moments.covariance(j, j));
  };
  EXPECT_NEAR(correlation(24, 26), 1.0, 1e-12);
  EXPECT_NEAR(correlation(24, 25), 0.0, 5.0 / std::sqrt(n));
  EXPECT_NEAR(correlation(25, 30), 0.0, 5.0 / std::sqrt(n));
}

// Of 8192 draws some 8 have the rare value: its law counts, not they.
TEST(DrawnMoments, OfOtherQuantitiesDoNotDependOnDerivedOnes) {
  DispersionSet laws = nominal_dispersions();
  laws[0].law = Law::discrete;
  laws[0].values = {0.0, 1.0};
  laws[0].probabilities = {0.999, 1e-3};
  laws[24] = normal_law(Law::normal, 1.0, 2.0);
  laws[25] = correlated(-1.0, 0.5, {"offcentring_m.x"}, {0.8});
  const DrawnMoments plain = drawn_moments(laws);
  EXPECT_DOUBLE_EQ(plain.mean[0], 1e-3);
  EXPECT_DOUBLE_EQ(deviation_of(plain, 0), std::sqrt(0.999e-3));
  EXPECT_DOUBLE_EQ(plain.covariance(25, 24), 0.8);
  EXPECT_EQ(plain.covariance(24, 25), plain.covariance(25, 24));
  EXPECT_EQ(plain.covariance(24, 26), 0.0);
  laws[5] = derived("scale_factor_error.sensor_1_x");
  const DrawnMoments sampled = drawn_moments(laws);
  for (const std::size_t i : {0U, 24U, 25U, 30U}) {
    EXPECT_EQ(sampled.mean[i], plain.mean[i]);
    EXPECT_DOUBLE_EQ(deviation_of(sampled, i), deviation_of(plain, i));
  }
  EXPECT_NEAR(sampled.covariance(25, 24), 0.8, 5.0 * 0.36 / std::sqrt(8192.0));
  // The last quantity is fixed.
  const Eigen::MatrixXd drawn = sampled.covariance.topLeftCorner(num_drawn - 1, num_drawn - 1);
  const Eigen::LLT<Eigen::MatrixXd> factors(drawn +
                                            1e-12 * Eigen::MatrixXd(drawn.diagonal().asDiagonal()));
  EXPECT_EQ(factors.info(), Eigen::Success);
}

// Sample covariances of three quantities: each within five standard errors, √((1 + ρ²)/n).
TEST(CorrelatedLaw, HasItsCorrelations) {
  DispersionSet laws = nominal_dispersions();
  laws[24] = normal_law(Law::normal, 1.0, 2.0);
  laws[25] = correlated(-1.0, 0.5, {"offcentring_m.x"}, {0.8});
  laws[30] = correlated(0.0, 3.0, {"offcentring_m.y", "offcentring_m.x"}, {-0.4, 0.1});
  ASSERT_EQ(refusal_of(laws), "");
  const Eigen::Vector3d mean(1.0, -1.0, 0.0), deviation(2.0, 0.5, 3.0);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
  for (std::uint64_t run = 0; run < num_runs; ++run) {
    const DrawnValues values = draw(laws, run);
    const Eigen::Vector3d z =
        (Eigen::Vector3d(values[24], values[25], values[30]) - mean).cwiseQuotient(deviation);
    sum += z;
    products += z * z.transpose();
  }
  Eigen::Matrix3d expected;
  expected << 1.0, 0.8, 0.1, 0.8, 1.0, -0.4, 0.1, -0.4, 1.0;
  const auto n = static_cast<double>(num_runs);
  for (Eigen::Index i = 0; i < 3; ++i) {
    EXPECT_NEAR(sum(i) / n, 0.0, 5.0 / std::sqrt(n));
    for (Eigen::Index j = 0; j < 3; ++j) {
      const double rho = expected(i, j);
      EXPECT_NEAR(products(i, j) / n, rho, 5.0 * std::sqrt((1.0 + rho * rho) / n));
    }
  }
}

TEST(CorrelatedLaw, RefusesWhatIsNoCorrelation) {
  const std::string y = "dispersion.offcentring_m.y.", z = "dispersion.offcentring_m.z.";
  DispersionSet laws = nominal_dispersions();
  laws[25] = correlated(0.0, 1.0, {"offcentring_m.x"}, {0.8});
  EXPECT_EQ(refusal_of(laws),
            y + "with = \"offcentring_m.x\" (must have the law normal or correlated)");
  laws[24] = normal_law(Law::normal, 0.0, 1.0);
  laws[25].with = {"offcentring_m.z"};
  EXPECT_EQ(refusal_of(laws), y + "with = \"offcentring_m.z\" (must come before it in the order of "
                                  "drawn quantities)");
  laws[25].with = {"q"};
  EXPECT_EQ(refusal_of(laws), y + "with = \"q\" (is no drawn quantity)");
  laws[25] = correlated(0.0, 1.0, {"offcentring_m.x", "offcentring_m.x"}, {0.1, 0.1});
  EXPECT_EQ(refusal_of(laws), y + "with = \"offcentring_m.x\" (is there twice)");
  laws[25].correlations = {0.1};
  EXPECT_EQ(refusal_of(laws),
            y + "correlations = 1 of them (must be 2, one for each quantity of `with`)");
  // det [[1, .9, .9], [.9, 1, 0], [.9, 0, 1]] = 1 - 1.62 < 0.
  laws[25] = correlated(0.0, 1.0, {"offcentring_m.x"}, {0.9});
  laws[26] = correlated(0.0, 1.0, {"offcentring_m.x", "offcentring_m.y"}, {0.9, 0.0});
  EXPECT_EQ(refusal_of(laws), z + "correlations = [0.9, 0] (with those before it, the correlations "
                                  "must be positive definite; `covariances` give them over both "
                                  "standard deviations)");
}

TEST(DiscreteLaw, RefusesWhatAreNoProbabilities) {
  const std::string path = "dispersion.scale_factor_error.sensor_1_x.";
  DispersionSet laws = nominal_dispersions();
  laws[0].law = Law::discrete;
  EXPECT_EQ(refusal_of(laws), path + "values = 0 of them (must be 1 to 64)");
  laws[0].values = {1.0, 2.0};
  laws[0].probabilities = {1.0};
  EXPECT_EQ(refusal_of(laws), path + "probabilities = 1 of them (must be 2, one for each value)");
  laws[0].probabilities = {1.5, -0.5};
  EXPECT_EQ(refusal_of(laws), path + "probabilities = -0.5 (must be >= 0)");
  laws[0].probabilities = {0.5, 0.25};
  EXPECT_EQ(refusal_of(laws), path + "probabilities = 0.75 together (must be 1, to 1e-9)");
}

TEST(TruncatedLaw, RefusesWhatADoubleCannotHold) {
  const std::string path = "dispersion.scale_factor_error.sensor_1_x.";
  DispersionSet laws = nominal_dispersions();
  laws[0] = normal_law(Law::truncated, 40.0, 1.0);
  laws[0].maximum = 1.0;
  EXPECT_EQ(refusal_of(laws),
            path + "mean = 40 (must be at most 30 standard deviations beyond [0, 1])");
  laws[0] = normal_law(Law::truncated, 0.0, 1.0);
  laws[0].maximum = 5e-7;
  EXPECT_EQ(refusal_of(laws),
            path + "standard_deviation = 1 (must be <= 1e+06 (maximum - minimum), 0.5)");
}

// Runs of one instrument share its draws; those of today are the same.
TEST(Realisations, ShareTheDrawsOfTheirInstrument) {
  MicroscopeCampaign plain;
  plain.num_runs = 12;
  MicroscopeCampaign campaign = plain;
  campaign.realisations = 4;
  for (std::uint64_t run = 0; run < 12; ++run) {
    const RunDraw of_run = campaign.draw(RunIndex{run}), expected = plain.draw(RunIndex{run / 4});
    EXPECT_EQ(of_run.values, expected.values);
    EXPECT_EQ(of_run.truth, expected.truth);
    EXPECT_EQ(of_run.num_draws, expected.num_draws);
  }
  EXPECT_NE(campaign.draw(RunIndex{3}).values, campaign.draw(RunIndex{4}).values);
}

TEST(Realisations, AreANumber) {
  MicroscopeCampaign campaign;
  campaign.realisations = 0;
  EXPECT_THROW(campaign.validate(), ConfigError);
  campaign.realisations = realisations_max + 1;
  EXPECT_EQ(test::message_of<ConfigError>([&] { campaign.validate(); }),
            "campaign.realisations = 4097 (must be in [1, 4096])");
}

}  // namespace
}  // namespace proofmass
