#include "core/microscope/control/star_tracker.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <numbers>

namespace proofmass {

StarTracker make_star_tracker(const NoiseConfig& noise, double sample_period_s) {
  // A one-sided density A² is the variance A²/(2T) of each sample.
  const double across = noise.star_tracker_across_asd_rad * noise.star_tracker_across_asd_rad /
                        (2.0 * sample_period_s);
  const double about = noise.star_tracker_boresight_asd_rad * noise.star_tracker_boresight_asd_rad /
                       (2.0 * sample_period_s);
  std::array<Eigen::Matrix3d, 2> information;
  for (const std::size_t head : {0U, 1U}) {
    const double half_root = std::numbers::sqrt2 / 2.0;
    const Eigen::Vector3d boresight_S(0.0, head == 0 ? half_root : -half_root, half_root);
    information[head] = Eigen::Matrix3d::Identity() / across +
                        (1.0 / about - 1.0 / across) * boresight_S * boresight_S.transpose();
  }
  const Eigen::Matrix3d covariance = (information[0] + information[1]).inverse();
  const Eigen::LLT<Eigen::Matrix3d> cholesky(covariance);
  return {.noise_factor_S_rad = cholesky.matrixL(),
          .weight = {covariance * information[0], covariance * information[1]}};
}

Eigen::Vector3d StarTracker::fused_bias_S(const std::array<Eigen::Vector3d, 2>& head_bias_S) const {
  return weight[0] * head_bias_S[0] + weight[1] * head_bias_S[1];
}

}  // namespace proofmass
