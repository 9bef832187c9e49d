#include "core/definition/document.hpp"
#include "core/error.hpp"
#include "core/microscope/campaign/microscope_campaign.hpp"
#include "core/microscope/definition/campaign_definition.hpp"
#include "tests/support/parse_campaign.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

constexpr std::uint64_t design_seed = 23;
constexpr SamplingDesign latin_of_250{.kind = DesignKind::latin_hypercube, .points = 250};
constexpr SamplingDesign net_of_256{.kind = DesignKind::sobol, .points = 256};

double normal_share_below(double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); }

Dispersion law_within_bounds(Law law, double mean) {
  Dispersion bounded;
  bounded.law = law;
  bounded.mean = mean;
  bounded.standard_deviation = 0.5;
  bounded.minimum = -1.0;
  bounded.maximum = 0.25;
  return bounded;
}

double share_below(const Dispersion& law, double x) {
  if (law.law == Law::uniform) return (x - law.minimum) / (law.maximum - law.minimum);
  const auto below = [&law](double value) {
    return normal_share_below((value - law.mean) / law.standard_deviation);
  };
  if (law.law == Law::normal) return below(x);
  return (below(x) - below(law.minimum)) / (below(law.maximum) - below(law.minimum));
}

/// The values of a quantity in the second replicate.
std::vector<double> replicate_values(const DispersionSet& laws, std::size_t quantity,
                                     const SamplingDesign& design) {
  std::vector<double> values;
  for (std::uint64_t i = 0; i < design.points; ++i) {
    values.push_back(
        draw_values(laws, design_seed, RunIndex{design.points + i}, 0, {}, design)[quantity]);
  }
  return values;
}

/// Whether each of equal parts of (0, 1) has one of the numbers, which are exact to 1e-12.
void expect_one_in_each_part(std::vector<double> numbers) {
  std::ranges::sort(numbers);
  const auto count = static_cast<double>(numbers.size());
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    ASSERT_GE(numbers[i], static_cast<double>(i) / count - 1e-12) << i;
    ASSERT_LE(numbers[i], static_cast<double>(i + 1) / count + 1e-12) << i;
  }
}

TEST(Design, HasOneDrawInEachPartOfEqualProbabilityOfALaw) {
  DispersionSet laws = nominal_dispersions();
  laws[1] = law_within_bounds(Law::normal, 2.0);
  laws[2] = law_within_bounds(Law::truncated, 1.0);
  laws[3] = law_within_bounds(Law::truncated_normal, 0.1);
  laws[59] = law_within_bounds(Law::truncated, -1.5);
  for (const SamplingDesign& design : {latin_of_250, net_of_256}) {
    for (const std::size_t quantity : {0U, 1U, 2U, 3U, 59U}) {
      std::vector<double> numbers = replicate_values(laws, quantity, design);
      for (double& number : numbers) number = share_below(laws[quantity], number);
      expect_one_in_each_part(std::move(numbers));
    }
  }
}

TEST(Design, HasDiscreteValuesAsOftenAsTheirProbabilitiesSay) {
  DispersionSet laws = nominal_dispersions();
  laws[4].law = Law::discrete;
  laws[4].values = {3.0, 1.0, 2.0};
  laws[4].probabilities = {0.125, 0.5, 0.375};
  const std::vector<double> values = replicate_values(laws, 4, net_of_256);
  EXPECT_EQ(std::ranges::count(values, 3.0), 32);
  EXPECT_EQ(std::ranges::count(values, 1.0), 128);
  EXPECT_EQ(std::ranges::count(values, 2.0), 96);
}

// x = z₁ and y = 0.6 z₁ + 0.8 z₂, z₁ and z₂ each having one value in each part.
TEST(Design, CorrelatesDeviatesThatCoverTheirLaws) {
  DispersionSet laws = nominal_dispersions();
  laws[24] = law_within_bounds(Law::normal, 0.0);
  laws[25] = laws[24];
  laws[25].law = Law::correlated;
  laws[25].with = {"offcentring_m.x"};
  laws[25].correlations = {0.6};
  const std::vector<double> x = replicate_values(laws, 24, net_of_256),
                            y = replicate_values(laws, 25, net_of_256);
  std::vector<double> numbers;
  for (std::size_t i = 0; i < x.size(); ++i) {
    numbers.push_back(normal_share_below((y[i] - 0.6 * x[i]) / (0.8 * 0.5)));
  }
  expect_one_in_each_part(std::move(numbers));
}

MicroscopeCampaign campaign_with_design(const SamplingDesign& design, std::uint64_t num_runs) {
  MicroscopeCampaign campaign;
  campaign.seed = design_seed;
  campaign.design = design;
  campaign.num_runs = num_runs;
  return campaign;
}

TEST(Design, ReplacesADrawThatIsNotAcceptedByAnIndependentOne) {
  for (const SamplingDesign& design : {latin_of_250, net_of_256}) {
    const MicroscopeCampaign campaign = campaign_with_design(design, 2 * design.points);
    std::uint64_t num_drawn_again = 0;
    for (std::uint64_t run = 0; run < campaign.num_runs; ++run) {
      const AcceptedDraw draw = draw_instrument(campaign, RunIndex{run}, {});
      const std::uint32_t last = draw.num_draws - 1;
      if (last > 0) ++num_drawn_again;
      EXPECT_EQ(draw.values, draw_values(campaign.dispersions, design_seed, RunIndex{run}, last, {},
                                         last == 0 ? design : SamplingDesign{}));
    }
    EXPECT_GT(num_drawn_again, 0U);
    EXPECT_LT(num_drawn_again, campaign.num_runs);
  }
}

TEST(Design, KeepsTheDrawsOfEarlierRunsInAnyOrder) {
  for (const SamplingDesign& design : {latin_of_250, net_of_256}) {
    const MicroscopeCampaign campaign = campaign_with_design(design, design.points);
    const MicroscopeCampaign extended = campaign_with_design(design, 3 * design.points);
    std::vector<DrawnValues> backwards;
    for (std::uint64_t run = extended.num_runs; run-- > 0;) {
      backwards.push_back(draw_instrument(extended, RunIndex{run}, {}).values);
    }
    std::ranges::reverse(backwards);
    for (std::uint64_t run = 0; run < campaign.num_runs; ++run) {
      EXPECT_EQ(draw_instrument(campaign, RunIndex{run}, {}).values, backwards[run]);
    }
    EXPECT_EQ(std::set(backwards.begin(), backwards.end()).size(), backwards.size());
  }
}

std::string design_refusal(const MicroscopeCampaign& campaign) {
  return test::message_of<ConfigError>([&] { campaign.validate(TableColumns::left_out); });
}

TEST(Design, RefusesWhatWouldNotBeEven) {
  MicroscopeCampaign campaign = campaign_with_design({.kind = DesignKind::sobol, .points = 48}, 96);
  EXPECT_EQ(design_refusal(campaign),
            "campaign.points = 48 (must be a power of two with campaign.design = \"sobol\", whose "
            "points are even only then)");
  campaign.design.kind = DesignKind::latin_hypercube;
  EXPECT_EQ(design_refusal(campaign), "");
  campaign.num_runs = 100;
  EXPECT_EQ(
      design_refusal(campaign),
      "campaign.runs = 100 (must be a multiple of campaign.points, 48, with campaign.design = "
      "\"latin_hypercube\": 96 or 144)");
  campaign.num_runs = 40;
  EXPECT_THAT(design_refusal(campaign), EndsWith("\"latin_hypercube\": 48)"));
  campaign.design.points = 1025;
  EXPECT_EQ(design_refusal(campaign), "campaign.points = 1025 (must be in [2, 1024])");
}

TEST(Design, RefusesWhatDependsOtherwise) {
  MicroscopeCampaign campaign = campaign_with_design(net_of_256, 256);
  campaign.realisations = 4;
  EXPECT_EQ(design_refusal(campaign),
            "campaign.design = \"sobol\" (must be \"random\" with campaign.realisations, which "
            "needs independent instruments)");
  campaign.realisations = 1;
  campaign.dispersions[24].law = Law::table;
  campaign.dispersions[24].file = "points.csv";
  campaign.dispersions[24].column = "x";
  EXPECT_EQ(design_refusal(campaign),
            "campaign.design = \"sobol\" (must be \"random\" with a table that is not declared "
            "independent, dispersion.offcentring_m.x)");
  campaign.dispersions[24].is_independent = true;
  EXPECT_EQ(design_refusal(campaign), "");
}

MicroscopeCampaign read_design(std::string_view text) { return test::parse_campaign("file", text); }

TEST(Design, IsReadAndWritten) {
  const MicroscopeCampaign nominal =
      read_design("campaign.name = \"a\"\ncampaign.runs = 64\ncampaign.design = \"sobol\"\n");
  EXPECT_EQ(nominal.design, (SamplingDesign{.kind = DesignKind::sobol, .points = 32}));
  const MicroscopeCampaign other = read_design(
      "[campaign]\nname = \"a\"\nruns = 14\ndesign = \"latin_hypercube\"\npoints = 7\n");
  EXPECT_EQ(other.design, (SamplingDesign{.kind = DesignKind::latin_hypercube, .points = 7}));
  EXPECT_EQ(campaign_of(definition_of(other)).design, other.design);
  EXPECT_THAT(canonical_definition(MicroscopeCampaign{}), Not(HasSubstr("\ndesign")));

  const std::vector<DefinitionDifference> differences = nominal.differences_from(other);
  ASSERT_THAT(differences, SizeIs(2));
  EXPECT_EQ(differences[0].field, "campaign.design");
  EXPECT_EQ(differences[0].second, "latin_hypercube");
  EXPECT_EQ(differences[1].field, "campaign.points");
  EXPECT_EQ(test::message_of<DefinitionError>(
                [] { (void)read_design("[campaign]\nname = \"a\"\npoints = 32\n"); }),
            "file:3: campaign.points = 32 (only with campaign.design, which is \"random\")");
}

}  // namespace
}  // namespace proofmass
