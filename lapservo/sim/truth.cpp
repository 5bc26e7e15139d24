#include "lapservo/sim/truth.h"

#include <stdexcept>

#include <fmt/format.h>

#include "lapservo/kinematics/centre_line.h"
#include "lapservo/kinematics/features.h"

namespace lapservo::internal {

TruthCsv::TruthCsv(const std::filesystem::path& path) : file_(path) {
  file_.stream() << "file,instrument,condition,theta_rad,phi_rad,rho_m,psi_rad,tau_rad,"
                    "e0_u_px,e0_v_px,e1_u_px,e1_v_px,e2_u_px,e2_v_px,e3_u_px,e3_v_px,"
                    "s_rad,r_px,l_px,d_px,rcm_u_px,rcm_v_px\n";
}

void TruthCsv::add(const std::string& file, const std::string& condition, const Camera& camera,
                   const Instrument& instrument, const JointVector& q) {
  const Rigid3& camera_from_rcm = instrument.camera_from_rcm.value();
  const auto line = centre_line(camera, instrument.marker, camera_from_rcm * rcm_from_unrolled(q), q.psi_rad);
  const auto rcm_px = projected_rcm_px(camera, camera_from_rcm);
  if (!line || !rcm_px) throw std::invalid_argument("the marker does not lie before the camera");
  const Features f = features_of(line->ideal_px, rcm_px);
  std::string row = fmt::format("{},{},{},{:.7f},{:.7f},{:.7f},{:.7f},{:.7f}", file, instrument.name, condition,
                                q.theta_rad, q.phi_rad, q.rho_m, q.psi_rad, line->tau_rad);
  for (const Eigen::Vector2d& ideal : line->ideal_px) {
    const Eigen::Vector2d raw = camera.raw_from_ideal(ideal);
    row += fmt::format(",{:.7f},{:.7f}", raw.x(), raw.y());
  }
  row += fmt::format(",{:.7f},{:.7f},{:.7f},{:.7f},{:.7f},{:.7f}", f.s_rad, *f.r_px, f.l_px, f.d_px, rcm_px->x(),
                     rcm_px->y());
  file_.stream() << row << '\n';
}

}  // namespace lapservo::internal
