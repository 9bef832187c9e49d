#include "core/definition/definition_text.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string>

#include "core/microscope/definition/campaign_definition.hpp"

namespace proofmass {
namespace {

using detail::number_text;
using detail::quoted_text;

// The bits of a number that went through a definition.
std::uint64_t bits_through_file(double value) {
  MicroscopeCampaign campaign = hardy2013_campaign();
  campaign.dispersions[0] = Dispersion{};
  campaign.dispersions[0].law = Law::fixed;
  campaign.dispersions[0].value = value;
  const MicroscopeCampaign read = campaign_of(campaign.definition(TableColumns::included));
  return std::bit_cast<std::uint64_t>(read.dispersions[0].value);
}

TEST(NumberText, IsShortAndPlain) {
  EXPECT_EQ(number_text(0.1), "0.1");
  EXPECT_EQ(number_text(5950.0), "5950");
  EXPECT_EQ(number_text(1e-5), "1e-5");
  EXPECT_EQ(number_text(-1e20), "-1e20");
  EXPECT_EQ(number_text(1e-300), "1e-300");
  EXPECT_EQ(number_text(-0.0), "-0.0");
}

TEST(NumberText, ReadsBackToTheSameBits) {
  using limits = std::numeric_limits<double>;
  const std::array<double, 12> values{0.1,
                                      1e-300,
                                      -0.0,
                                      0.0,
                                      1.0 / 3.0,
                                      limits::max(),
                                      limits::min(),
                                      limits::denorm_min(),
                                      9007199254740993.0,
                                      123456789012345680.0,
                                      1e15,
                                      4.84813681109536e-5};
  for (const double value : values) {
    EXPECT_EQ(bits_through_file(value), std::bit_cast<std::uint64_t>(value)) << value;
  }
}

TEST(NumberText, ReadsBackToTheSameBitsForAnyFiniteNumber) {
  std::mt19937_64 bits(7);
  for (int i = 0; i < 200; ++i) {
    const auto value = std::bit_cast<double>(bits());
    if (!std::isfinite(value)) continue;
    EXPECT_EQ(bits_through_file(value), std::bit_cast<std::uint64_t>(value)) << value;
  }
}

TEST(QuotedText, EscapesWhatTomlDoesNotTakePlain) {
  EXPECT_EQ(quoted_text("a\"b\\c"), R"("a\"b\\c")");
  EXPECT_EQ(quoted_text("a\nb"), R"("a\u000Ab")");
  EXPECT_EQ(quoted_text("Δx"), "\"Δx\"");
}

TEST(Alternatives, AreJoinedForPeople) {
  constexpr std::array<std::string_view, 3> three{"a", "b", "c"};
  EXPECT_EQ(detail::alternatives(three), R"("a", "b" or "c")");
  EXPECT_EQ(detail::alternatives(std::span(three).first(1)), R"("a")");
}

}  // namespace
}  // namespace proofmass
