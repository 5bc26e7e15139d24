// The results of a calibration go into the rig, and all other keys stay.

#include <gtest/gtest.h>

#include "lapservo/calibration/camera/camera_measurement.h"
#include "lapservo/calibration/colour/colour_calibration.h"
#include "lapservo/calibration/registration/registration_measurement.h"
#include "lapservo/testing/scenes.h"

namespace lapservo::internal::measured_rig_test {

Rig measured_before() {
  Rig rig = scenes::usual_rig(2);
  rig.camera_file = "camera.yaml";
  rig.camera.response.sigma = 0.01, rig.camera.deinterlace = true;
  rig.instruments[1].image_delay_s = 0.1, rig.instruments[1].sigma_image_delay_s = 0.002;
  rig.instruments[1].sigma_quaternion_xyzw = {1e-3, 1e-3, 1e-3, 1e-3};
  return rig;
}

TEST(MeasuredRig, HoldsOtherColours) {
  const Rig before = measured_before();
  ColourCalibration calibration;
  calibration.hues_deg = {181, 97.123456, 269.5}, calibration.sigma_hues_deg = {0.5, 0.512345, 1};
  Rig expected = before;
  expected.instruments[1].marker.hues_deg = {181, 97.12, 269.5};
  expected.instruments[1].marker.sigmas.hues_deg = {0.5, 0.512, 1};
  EXPECT_EQ(with_colour(before, 1, calibration), expected);
  calibration.response = Response{Response::Kind::power, 1.8};
  expected.camera.response = *calibration.response, expected.camera_file.clear();
  EXPECT_EQ(with_colour(before, 1, calibration), expected);
}

TEST(MeasuredRig, HoldsAnotherRegistration) {
  const Instrument before = measured_before().instruments[1];
  Registration registration;
  registration.camera_from_rcm = {Eigen::Quaterniond(0.3, 0.4, -0.5, 0.7).normalized(), {0.1, -1.0 / 3, 0.25}};
  registration.sigma_translation_m = {1e-5, 2.0004e-5, 3e-5};
  Instrument expected = before;
  expected.camera_from_rcm = registration.camera_from_rcm;
  expected.sigma_translation_m = {1e-5, 2e-5, 3e-5};
  expected.sigma_quaternion_xyzw.reset();  // the old one's
  EXPECT_EQ(registered(before, registration), expected);

  // With the rig's own rotation.
  Instrument known = before;
  known.registration_covariance = Eigen::Matrix<double, 6, 6>::Identity() * 0.1 + Eigen::Matrix<double, 6, 6>::Ones();
  registration.camera_from_rcm.rotation = known.camera_from_rcm->rotation;
  const Instrument moved = registered(known, registration);
  EXPECT_EQ(moved.sigma_quaternion_xyzw, known.sigma_quaternion_xyzw);
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  covariance.diagonal().head<3>() << 1e-10, 4.0016e-10, 9e-10;
  covariance.bottomRightCorner<3, 3>() = known.registration_covariance->bottomRightCorner<3, 3>();
  EXPECT_EQ(moved.registration_covariance, covariance);
  registration.camera_from_rcm.rotation = expected.camera_from_rcm->rotation;

  registration.sigma_quaternion = Eigen::Vector4d(1e-4, 2e-4, 3e-4, 4e-4);
  registration.arm = Registration::Arm{{{"yaw", "pitch", "insertion", "roll"}, {1, -1, 1, 1}, {0, 1.0 / 7, 0.02, -3}},
                                       {0, 1e-3, 2e-3, 3e-3},
                                       1.0 / 9,
                                       0.00100004};
  registration.arm->covariance.diagonal().head<6>() << Eigen::Vector3d::Constant(4e-8),
      Eigen::Vector3d::Constant(1.0 / 3e9);
  const Instrument measured = registered(before, registration);
  expected.registration_covariance = measured.registration_covariance;
  Eigen::Matrix<double, 6, 1> variances;
  variances << Eigen::Vector3d::Constant(3.33333e-10), Eigen::Vector3d::Constant(4e-8);
  EXPECT_TRUE(measured.registration_covariance->isApprox(variances.asDiagonal().toDenseMatrix(), 1e-9));
  expected.sigma_quaternion_xyzw = {1e-4, 2e-4, 3e-4, 4e-4};
  expected.joints = registration.arm->joints, expected.joints->sigma_offset = registration.arm->sigma_offset;
  expected.image_delay_s = 1.0 / 9, expected.sigma_image_delay_s = 0.001;
  EXPECT_EQ(measured, expected);
}

TEST(MeasuredRig, HoldsAnotherCamera) {
  CameraCalibration calibration;
  calibration.camera = measured_before().camera;
  calibration.camera.fx_px = 501.25;
  Camera expected = calibration.camera;
  calibration.camera.sigmas.fx_px = 0.12504, calibration.camera.sigmas.red = 1.00004e-5;
  calibration.camera.covariance.emplace().setZero();
  calibration.camera.covariance->diagonal().setConstant(1.0 / 3);
  expected.sigmas.fx_px = 0.125, expected.sigmas.red = 1e-5;
  expected.covariance.emplace().setZero();
  expected.covariance->diagonal().setConstant(0.333333);
  EXPECT_EQ(measured_camera(calibration), expected) << "its response was not measured this time: it stays";
  calibration.response = ResponseFit{};
  calibration.response->sigma = 0.00300004, expected.response.sigma = 0.003;
  EXPECT_EQ(measured_camera(calibration), expected);
}

}  // namespace lapservo::internal::measured_rig_test
