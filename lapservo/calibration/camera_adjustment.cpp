#include "lapservo/calibration/camera_adjustment.h"

#include <algorithm>
#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <cmath>
#include <cstddef>
#include <utility>

#include "lapservo/calibration/robust_scale.h"
#include "lapservo/calibration/solve_quietly.h"
#include "lapservo/geometry/rotation.h"

namespace lapservo::internal {
namespace {

// fx, fy / fx, cx, cy, k1, k2, p1, p2, k3; magnifications of blue and red; of a view: rotation vector and translation,
// and how far its edges lie towards dark squares in each channel.
constexpr int camera_numbers = 9, aspect = 1, k3 = 8, pose_numbers = 6, channels = 3;
using CameraBlock = std::array<double, camera_numbers>;
using PoseBlock = std::array<double, pose_numbers>;

constexpr double loss_scale_sigmas = 3;
// What neighbouring edges share and a fit of one doesn't tell: a floor for its sigma.
constexpr double least_sigma_px = 0.01;
constexpr double shift_sigma_px = 0.2;

struct EdgeCost {
  EdgePoint point;
  double sigma_px;

  template <typename T>
  bool operator()(const T* camera, const T* magnifications, const T* shifts_px, const T* pose, const T* wider_px,
                  T* residual) const {
    const T on_board[3] = {T(point.point_m.x()), T(point.point_m.y()), T(point.point_m.z())};
    T p[3];
    ceres::AngleAxisRotatePoint(pose, on_board, p);
    for (int i = 0; i < 3; ++i) p[i] += pose[3 + i];
    const T x = p[0] / p[2], y = p[1] / p[2], r2 = x * x + y * y;
    const T radial = T(1) + r2 * (camera[4] + r2 * (camera[5] + r2 * camera[8]));
    const T dx = x * radial + T(2) * camera[6] * x * y + camera[7] * (r2 + T(2) * x * x);
    const T dy = y * radial + camera[6] * (r2 + T(2) * y * y) + T(2) * camera[7] * x * y;
    T u = camera[0] * dx, v = camera[0] * camera[1] * dy;
    if (point.channel != 1) {
      const int other = point.channel == 0 ? 0 : 1;
      u = magnifications[other] * u + shifts_px[2 * other], v = magnifications[other] * v + shifts_px[2 * other + 1];
    }
    u += camera[2], v += camera[3];
    const T beyond = T(point.normal.x()) * (point.raw_px.x() - u) + T(point.normal.y()) * (point.raw_px.y() - v);
    residual[0] = (beyond + T(point.towards_bright) * wider_px[point.channel]) / sigma_px;
    return true;
  }
};

// What demosaicing and chroma filters shift blue and red by, all over the picture, is no magnification.
struct ShiftPrior {
  template <typename T>
  bool operator()(const T* shifts_px, T* residuals) const {
    for (int i = 0; i < 4; ++i) residuals[i] = shifts_px[i] / shift_sigma_px;
    return true;
  }
};

CameraBlock block_of(const Camera& camera) {
  const auto& k = camera.distortion;
  return {camera.fx_px, camera.fy_px / camera.fx_px, camera.cx_px, camera.cy_px, k[0], k[1], k[2], k[3], k[4]};
}

Camera camera_of(const CameraBlock& block, const std::array<double, 2>& magnifications, Camera camera) {
  camera.fx_px = block[0], camera.fy_px = block[0] * block[1], camera.cx_px = block[2], camera.cy_px = block[3];
  std::copy(block.begin() + 4, block.end(), camera.distortion.begin());
  camera.chromatic_aberration = {magnifications[0], magnifications[1]};
  return camera;
}

PoseBlock block_of(const Rigid3& pose) {
  const Eigen::Vector3d rotation = rotation_vector_of(pose.rotation), &t = pose.translation;
  return {rotation.x(), rotation.y(), rotation.z(), t.x(), t.y(), t.z()};
}

Rigid3 pose_of(const PoseBlock& block) {
  return {rotation_by({block[0], block[1], block[2]}), {block[3], block[4], block[5]}};
}

struct Sigmas {
  CameraSigmas camera;
  double aspect = 0;
};

std::optional<Sigmas> sigmas_of(ceres::Problem& problem, const CameraBlock& camera,
                                const std::array<double, 2>& magnifications, double scale) {
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::SPARSE_QR;
  ceres::Covariance covariance(options);
  const std::vector<std::pair<const double*, const double*>> blocks{{camera.data(), camera.data()},
                                                                    {magnifications.data(), magnifications.data()}};
  if (!covariance.Compute(blocks, &problem)) return std::nullopt;
  Eigen::Matrix<double, camera_numbers, camera_numbers, Eigen::RowMajor> c;
  Eigen::Matrix<double, 2, 2, Eigen::RowMajor> m;
  if (!covariance.GetCovarianceBlock(camera.data(), camera.data(), c.data()) ||
      !covariance.GetCovarianceBlock(magnifications.data(), magnifications.data(), m.data()))
    return std::nullopt;
  if (!c.allFinite() || !m.allFinite()) return std::nullopt;
  const auto sigma = [&](double variance) { return scale * std::sqrt(std::max(0.0, variance)); };
  Sigmas result;
  CameraSigmas& sigmas = result.camera;
  sigmas.fx_px = sigma(c(0, 0));
  sigmas.fy_px =
      sigma(camera[1] * camera[1] * c(0, 0) + 2 * camera[0] * camera[1] * c(0, 1) + camera[0] * camera[0] * c(1, 1));
  result.aspect = sigma(c(1, 1));
  sigmas.cx_px = sigma(c(2, 2)), sigmas.cy_px = sigma(c(3, 3));
  for (int i = 0; i < 5; ++i) sigmas.distortion[static_cast<std::size_t>(i)] = sigma(c(4 + i, 4 + i));
  sigmas.blue = sigma(m(0, 0)), sigmas.red = sigma(m(1, 1));
  return result;
}

}  // namespace

std::optional<CameraAdjustment> adjust_camera(const Camera& start, const std::vector<Rigid3>& camera_from_board,
                                              const std::vector<std::vector<EdgePoint>>& views,
                                              const CameraFreedom& freedom) {
  CameraBlock camera = block_of(start);
  if (!freedom.k3) camera[k3] = 0;
  if (!freedom.aspect) camera[aspect] = 1;
  std::array<double, 2> magnifications{start.chromatic_aberration.blue, start.chromatic_aberration.red};
  std::array<double, 4> shifts_px{};
  std::vector<PoseBlock> poses;
  for (const Rigid3& pose : camera_from_board) poses.push_back(block_of(pose));
  std::vector<std::array<double, channels>> wider_px(views.size());

  ceres::Problem problem;
  std::vector<std::vector<EdgeCost>> costs(views.size());
  std::array<bool, channels> seen{};
  for (std::size_t i = 0; i < views.size(); ++i)
    for (const EdgePoint& point : views[i]) {
      const EdgeCost cost{point, std::hypot(point.sigma_px, least_sigma_px)};
      costs[i].push_back(cost);
      seen[static_cast<std::size_t>(point.channel)] = true;
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<EdgeCost, 1, camera_numbers, 2, 4, pose_numbers, channels>(
              new EdgeCost(cost)),
          new ceres::CauchyLoss(loss_scale_sigmas), camera.data(), magnifications.data(), shifts_px.data(),
          poses[i].data(), wider_px[i].data());
    }
  problem.AddResidualBlock(new ceres::AutoDiffCostFunction<ShiftPrior, 4, 4>(new ShiftPrior), nullptr,
                           shifts_px.data());
  std::vector<int> fixed, fixed_channels;
  if (!freedom.aspect) fixed.push_back(aspect);
  if (!freedom.k3) fixed.push_back(k3);
  if (!fixed.empty()) problem.SetManifold(camera.data(), new ceres::SubsetManifold(camera_numbers, fixed));
  for (std::size_t c = 0; c < seen.size(); ++c)
    if (!seen[c]) fixed_channels.push_back(static_cast<int>(c));
  if (!seen[0] || !seen[2]) problem.SetParameterBlockConstant(magnifications.data());
  if (!fixed_channels.empty())
    for (auto& wider : wider_px)
      if (problem.HasParameterBlock(wider.data()))
        problem.SetManifold(wider.data(), new ceres::SubsetManifold(channels, fixed_channels));

  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::SPARSE_SCHUR;
  solver.max_num_iterations = 50;
  solver.function_tolerance = 1e-10;
  ceres::Solver::Summary summary;
  if (!solve_quietly(solver, problem, summary)) return std::nullopt;

  CameraAdjustment result;
  result.camera = camera_of(camera, magnifications, start);
  std::vector<double> in_sigmas;
  for (std::size_t i = 0; i < views.size(); ++i) {
    result.camera_from_board.push_back(pose_of(poses[i]));
    auto& residuals_px = result.residuals_px.emplace_back();
    for (const EdgeCost& cost : costs[i]) {
      double residual = 0;
      cost(camera.data(), magnifications.data(), shifts_px.data(), poses[i].data(), wider_px[i].data(), &residual);
      in_sigmas.push_back(residual);
      residuals_px.push_back(residual * cost.sigma_px);
    }
    for (std::size_t c = 0; c < channels; ++c)
      result.bright_wider_px[c] += wider_px[i][c] / static_cast<double>(views.size());
  }
  const auto sigmas = sigmas_of(problem, camera, magnifications, std::max(1.0, robust_scale(std::move(in_sigmas))));
  if (!sigmas) return std::nullopt;
  result.sigmas = sigmas->camera, result.sigma_aspect = sigmas->aspect;
  return result;
}

}  // namespace lapservo::internal
