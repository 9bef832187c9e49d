#include "core/microscope/control/star_tracker.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace proofmass {
namespace {

// The boresights are orthogonal, so along X, and along each boresight, the two heads' information
// adds: 2/σ², and 1/σ_b² + 1/σ² twice. The last two are equal, so the fused noise is isotropic in Y
// and Z.
TEST(StarTracker, FusesTwoHeadsByInverseCovariance) {
  NoiseConfig noise;
  noise.star_tracker_across_asd_rad = 7e-6;
  noise.star_tracker_boresight_asd_rad = 3.5e-5;
  const double samples_per_s = 4.0;
  const StarTracker tracker = make_star_tracker(noise, 1.0 / samples_per_s);
  const double across = 7e-6 * 7e-6 * samples_per_s / 2.0;  // One-sided density to sample variance.
  const double about = 25.0 * across;
  Eigen::Matrix3d expected = Eigen::Matrix3d::Zero();
  expected(0, 0) = across / 2.0;
  expected(1, 1) = expected(2, 2) = 1.0 / (1.0 / across + 1.0 / about);
  const Eigen::Matrix3d covariance =
      tracker.noise_factor_S_rad * tracker.noise_factor_S_rad.transpose();
  EXPECT_LT((covariance - expected).norm(), 1e-14 * across);
  EXPECT_LT((tracker.weight[0] + tracker.weight[1] - Eigen::Matrix3d::Identity()).norm(), 1e-14);
}

TEST(StarTracker, WeighsEachHeadsBiasWhereItSeesBest) {
  const StarTracker tracker = make_star_tracker({}, 0.25);
  // A bias of head 1 about its own boresight hardly counts: σ²/(σ² + σ_b²) = 1/26.
  const Eigen::Vector3d boresight = Eigen::Vector3d(0.0, 1.0, 1.0).normalized();
  const Eigen::Vector3d fused = tracker.fused_bias_S({1e-5 * boresight, Eigen::Vector3d::Zero()});
  EXPECT_LT((fused - 1e-5 / 26.0 * boresight).norm(), 1e-18);
  // About X both count alike.
  const Eigen::Vector3d x =
      tracker.fused_bias_S({Eigen::Vector3d(2e-5, 0, 0), Eigen::Vector3d::Zero()});
  EXPECT_NEAR(x.x(), 1e-5, 1e-19);
}

}  // namespace
}  // namespace proofmass
