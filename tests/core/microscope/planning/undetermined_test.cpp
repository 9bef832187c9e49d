#include <gmock/gmock.h>

#include <Eigen/Core>

#include "core/microscope/planning/plan_study.hpp"

namespace proofmass {
namespace {

using ::testing::ElementsAre;

/// The information of data that each see a sum of the unknowns.
/// @param sums  A row a datum.
Eigen::MatrixXd information_of(const Eigen::MatrixXd& sums) { return sums.transpose() * sums; }

// The first two are seen as a sum only, the third by itself, and the fourth not at all.
TEST(Undetermined, IsWhatNoDatumTellsApart) {
  Eigen::MatrixXd sums(3, 4);
  sums << 1.0, 1.0, 0.0, 0.0,  //
      2.0, 2.0, 0.0, 0.0,      //
      0.0, 0.0, 1.0, 0.0;
  EXPECT_THAT(undetermined_by(information_of(sums)), ElementsAre(0U, 1U, 3U));
}

// In units of nanometres and of 1e9 seconds squared per metre the same data tell the same.
TEST(Undetermined, DoesNotDependOnUnits) {
  Eigen::MatrixXd sums(4, 4);
  sums << 1.0, 2.0, 0.5, 0.0,  //
      0.0, 1.0, 0.5, 0.0,      //
      1.0, 3.0, 1.0, 0.0,      //
      0.0, 0.0, 0.0, 1.0;      // The third row is the sum of the first two.
  Eigen::Vector4d units(1e-9, 1e9, 1.0, 1e-3);
  EXPECT_THAT(undetermined_by(information_of(sums)), ElementsAre(0U, 1U, 2U));
  EXPECT_THAT(undetermined_by(information_of(sums * units.asDiagonal())), ElementsAre(0U, 1U, 2U));
}

// What is not seen is v. The diagonal of 1 − v vᵀ is 1 − v², so that its components in the units of
// the criterion are v √(1 − v²), and the last one is 0.035 or 0.14 of the whole.
TEST(Undetermined, LeavesOutWhatHasLittlePartInIt) {
  const auto found_with = [](double part) {
    const Eigen::Vector4d open = Eigen::Vector4d(1.0, 1.0, 1.0, part).normalized();
    return undetermined_by(Eigen::Matrix4d::Identity() - open * open.transpose());
  };
  EXPECT_THAT(found_with(0.05), ElementsAre(0U, 1U, 2U));
  EXPECT_THAT(found_with(0.2), ElementsAre(0U, 1U, 2U, 3U));
}

}  // namespace
}  // namespace proofmass
