#include "core/simulation/session_record.hpp"

namespace proofmass {

RegressorKind regressor_kind(SessionTarget target) {
  switch (target) {
    case SessionTarget::a_c12:
      return RegressorKind::modulated_yy;
    case SessionTarget::a_c13:
      return RegressorKind::modulated_zz;
    case SessionTarget::k2d:
      return RegressorKind::common_squared;
    case SessionTarget::k2_sensor_1:
      return RegressorKind::sensor_1_squared;
    case SessionTarget::k2_sensor_2:
      return RegressorKind::sensor_2_squared;
    default:
      return RegressorKind::none;
  }
}

}  // namespace proofmass
