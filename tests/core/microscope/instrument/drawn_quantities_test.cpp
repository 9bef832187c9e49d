#include "core/microscope/instrument/drawn_quantities.hpp"

#include "core/error.hpp"
#include "tests/test.hpp"

namespace proofmass {
namespace {

Dispersion law(Law kind, double minimum = 0.0, double maximum = 0.0, double mean = 0.0,
               double standard_deviation = 0.0) {
  Dispersion dispersion;
  dispersion.law = kind;
  dispersion.minimum = minimum;
  dispersion.maximum = maximum;
  dispersion.mean = mean;
  dispersion.standard_deviation = standard_deviation;
  return dispersion;
}

std::string refusal_of(const Dispersion& dispersion) {
  return test::message_of<ConfigError>([&] { dispersion.validate("d"); });
}

TEST(DrawGroups, CoverAllDrawnQuantitiesOnce) {
  std::size_t next = 0;
  for (const DrawGroup& group : draw_groups()) {
    EXPECT_EQ(group.first, next) << group.name;
    next += group.count;
  }
  EXPECT_EQ(next, num_drawn);
}

// The names are those of the random streams: a changed name changes every result.
TEST(DrawnNames, AreUniqueAndStable) {
  const auto& names = drawn_names();
  EXPECT_EQ(std::set<std::string>(names.begin(), names.end()).size(), num_drawn);
  EXPECT_EQ(names[0], "scale_factor_error.sensor_1_x");
  EXPECT_EQ(names[11], "misalignment_rad.sensor_2_z");
  EXPECT_EQ(names[15], "coupling_rad.sensor_2_x");
  EXPECT_EQ(names[18], "quadratic_factor_s2_m.sensor_1_x");
  EXPECT_EQ(names[26], "offcentring_m.z");
  EXPECT_EQ(names[27], "centre_of_mass_offset_m.x");
  EXPECT_EQ(names[30], "read_out_bias_m_s2.sensor_1_x");
  EXPECT_EQ(names[36], "parasitic_acceleration_m_s2.sensor_1_x");
  EXPECT_EQ(names[42], "thruster_scale_error.x");
  EXPECT_EQ(names[47], "thruster_coupling_rad.yx");
  EXPECT_EQ(names[53], "angular_bias_rad_s2.z");
  EXPECT_EQ(names[59], "star_tracker_bias_rad.head_2_z");
}

TEST(NominalDispersions, AreUniformInsideTheBounds) {
  const DispersionSet dispersions = nominal_dispersions();
  EXPECT_EQ(dispersions[24], law(Law::uniform, -20e-6, 20e-6));
  EXPECT_EQ(dispersions[59].maximum, 4.84813681109536e-5);
  for (std::size_t i = 0; i < num_drawn; ++i) EXPECT_EQ(refusal_of(dispersions[i]), "") << i;
}

TEST(TableElements, AreThoseWithATableAscending) {
  DispersionSet dispersions = nominal_dispersions();
  EXPECT_TRUE(table_elements(dispersions).empty());
  dispersions[40].law = Law::table;
  dispersions[3].law = Law::table;
  EXPECT_THAT(table_elements(dispersions), ElementsAre(3, 40));
}

TEST(DispersionValidate, WantsAnInterval) {
  EXPECT_EQ(refusal_of(law(Law::uniform, -1.0, 2.0)), "");
  EXPECT_EQ(refusal_of(law(Law::uniform, 1.0, 1.0)), "d.maximum = 1 (must be > minimum, 1)");
  EXPECT_EQ(refusal_of(law(Law::uniform, -1.7e308, 1.7e308)), "d.maximum = inf (must be finite)");
}

TEST(DispersionValidate, WantsASpread) {
  EXPECT_EQ(refusal_of(law(Law::normal, 0, 0, 3.0, 1.0)), "");
  EXPECT_EQ(refusal_of(law(Law::normal)), "d.standard_deviation = 0 (must be > 0)");
}

TEST(DispersionValidate, WantsATruncationThatLeavesDraws) {
  EXPECT_EQ(refusal_of(law(Law::truncated_normal, -1, 1, 0.5, 3)), "");
  EXPECT_EQ(refusal_of(law(Law::truncated_normal, -1, 1, 2, 3)), "d.mean = 2 (must be in [-1, 1])");
  EXPECT_EQ(refusal_of(law(Law::truncated_normal, 1, -1, 0, 3)),
            "d.maximum = -1 (must be > minimum, 1)");
  EXPECT_EQ(refusal_of(law(Law::truncated_normal, -1, 1, 0, 0)),
            "d.standard_deviation = 0 (must be > 0)");
  EXPECT_EQ(refusal_of(law(Law::truncated_normal, -1, 1, 0, 201)),
            "d.standard_deviation = 201 (must be <= 100 (maximum - minimum), 200)");
}

TEST(DispersionValidate, WantsFileAndColumnOfATable) {
  Dispersion table = law(Law::table);
  EXPECT_EQ(refusal_of(table), "d.file = \"\" (must name a file)");
  table.file = "draws.csv";
  EXPECT_EQ(refusal_of(table), "d.column = \"\" (must name a column)");
  table.column = "x";
  EXPECT_EQ(refusal_of(table), "");
}

TEST(DispersionValidate, RefusesWhatIsNotFiniteUnderAnyLaw) {
  const double infinity = std::numeric_limits<double>::infinity();
  Dispersion fixed = law(Law::fixed);
  EXPECT_EQ(refusal_of(fixed), "");
  fixed.value = infinity;
  EXPECT_EQ(refusal_of(fixed), "d.value = inf (must be finite)");
  EXPECT_EQ(refusal_of(law(Law::uniform, -infinity)), "d.minimum = -inf (must be finite)");
  EXPECT_EQ(refusal_of(law(Law::uniform, 0, infinity)), "d.maximum = inf (must be finite)");
  EXPECT_EQ(refusal_of(law(Law::normal, 0, 0, infinity)), "d.mean = inf (must be finite)");
  EXPECT_EQ(refusal_of(law(Law::normal, 0, 0, 0, infinity)),
            "d.standard_deviation = inf (must be finite)");
  EXPECT_EQ(refusal_of(law(static_cast<Law>(10))), "d.law = 10 (unknown law)");
}

}  // namespace
}  // namespace proofmass
