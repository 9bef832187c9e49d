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

std::size_t num_signals_used(SessionTarget target) {
  switch (target) {
    case SessionTarget::a_c11_delta_x:
    case SessionTarget::a_c11_delta_y:
    case SessionTarget::a_c11_delta_z:
      return num_signals;
    default:
      return num_common_signals;
  }
}

}  // namespace proofmass
