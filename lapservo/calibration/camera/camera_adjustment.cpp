#include "lapservo/calibration/camera/camera_adjustment.h"

#include <algorithm>
#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <cmath>
#include <cstddef>
#include <utility>

#include "lapservo/calibration/fit/ceres_fit.h"
#include "lapservo/core/departures.h"
#include "lapservo/core/statistics.h"
#include "lapservo/geometry/rotation.h"

namespace lapservo::internal {
namespace {

struct CameraUnknowns {
  double focal_px, aspect;  // fx, fy / fx
  std::array<double, 2> centre_px;
  std::array<double, 4> distortion;  // k1 k2 p1 p2
  double k3;
  std::array<double, 2> magnifications;  // of blue and red
  std::array<double, 4> shifts_px{};     // of blue and red
};

constexpr int pose_numbers = 6, channels = 3;
struct ViewUnknowns {
  std::array<double, pose_numbers> pose;    // rotation vector and translation
  std::array<double, channels> wider_px{};  // how far its edges lie towards dark squares in each channel
};

constexpr double loss_scale_sigmas = 3;
// Neighbouring edges err alike: by so many times an edge's own sigma a fault may be off.
constexpr double unmodelled_sigmas = 1.3;
// The common error of neighbouring edges, which a fit of one does not show: a floor for its sigma.
constexpr double least_sigma_px = 0.01;
constexpr double shift_sigma_px = 0.2;

struct EdgeCost {
  EdgePoint point;
  double sigma_px;

  // The point's image beyond the principal point.
  template <typename T>
  std::array<T, 2> projected(const T* focal_px, const T* aspect, const T* distortion, const T* k3,
                             const T* magnifications, const T* shifts_px, const T* pose) const {
    const T on_board[3] = {T(point.point_m.x()), T(point.point_m.y()), T(point.point_m.z())};
    T p[3];
    ceres::AngleAxisRotatePoint(pose, on_board, p);
    for (int i = 0; i < 3; ++i) p[i] += pose[3 + i];
    const T x = p[0] / p[2], y = p[1] / p[2], r2 = x * x + y * y;
    const T &k1 = distortion[0], &k2 = distortion[1], &p1 = distortion[2], &p2 = distortion[3];
    const T radial = T(1) + r2 * (k1 + r2 * (k2 + r2 * *k3));
    const T dx = x * radial + T(2) * p1 * x * y + p2 * (r2 + T(2) * x * x);
    const T dy = y * radial + p1 * (r2 + T(2) * y * y) + T(2) * p2 * x * y;
    T u = *focal_px * dx, v = *focal_px * *aspect * dy;
    if (point.channel != 1) {
      const int other = point.channel == 0 ? 0 : 1;
      u = magnifications[other] * u + shifts_px[2 * other], v = magnifications[other] * v + shifts_px[2 * other + 1];
    }
    return {u, v};
  }
  template <typename T>
  bool operator()(const T* focal_px, const T* aspect, const T* centre_px, const T* distortion, const T* k3,
                  const T* magnifications, const T* shifts_px, const T* pose, const T* wider_px, T* residual) const {
    const auto [x, y] = projected(focal_px, aspect, distortion, k3, magnifications, shifts_px, pose);
    const T u = x + centre_px[0], v = y + centre_px[1];
    const T beyond = T(point.normal.x()) * (point.raw_px.x() - u) + T(point.normal.y()) * (point.raw_px.y() - v);
    residual[0] = (beyond + T(point.towards_bright) * wider_px[point.channel]) / sigma_px;
    return true;
  }
  double residual(const CameraUnknowns& c, const ViewUnknowns& view) const {
    double residual = 0;
    (*this)(&c.focal_px, &c.aspect, c.centre_px.data(), c.distortion.data(), &c.k3, c.magnifications.data(),
            c.shifts_px.data(), view.pose.data(), view.wider_px.data(), &residual);
    return residual;
  }
  Eigen::Vector2d projected(const CameraUnknowns& c, const ViewUnknowns& view) const {
    const auto [x, y] = projected(&c.focal_px, &c.aspect, c.distortion.data(), &c.k3, c.magnifications.data(),
                                  c.shifts_px.data(), view.pose.data());
    return {x, y};
  }
  void add_to(ceres::Problem& problem, CameraUnknowns& c, ViewUnknowns& view) const {
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<EdgeCost, 1, 1, 1, 2, 4, 1, 2, 4, pose_numbers, channels>(new EdgeCost(*this)),
        new ceres::CauchyLoss(loss_scale_sigmas), &c.focal_px, &c.aspect, c.centre_px.data(), c.distortion.data(),
        &c.k3, c.magnifications.data(), c.shifts_px.data(), view.pose.data(), view.wider_px.data());
  }
};

// Shifts of blue and red by demosaicing and chroma filters, equal all over the image, are no magnification.
struct ShiftPrior {
  template <typename T>
  bool operator()(const T* shifts_px, T* residuals) const {
    for (int i = 0; i < 4; ++i) residuals[i] = shifts_px[i] / shift_sigma_px;
    return true;
  }
};

CameraUnknowns unknowns_of(const Camera& camera) {
  const auto& k = camera.distortion;
  const ChromaticAberration& aberration = camera.chromatic_aberration;
  return {camera.fx_px, camera.fy_px / camera.fx_px,      {camera.cx_px, camera.cy_px}, {k[0], k[1], k[2], k[3]},
          k[4],         {aberration.blue, aberration.red}};
}

Camera camera_of(const CameraUnknowns& c, Camera camera) {
  camera.fx_px = c.focal_px, camera.fy_px = c.focal_px * c.aspect;
  camera.cx_px = c.centre_px[0], camera.cy_px = c.centre_px[1];
  camera.distortion = {c.distortion[0], c.distortion[1], c.distortion[2], c.distortion[3], c.k3};
  camera.chromatic_aberration = {c.magnifications[0], c.magnifications[1]};
  return camera;
}

ViewUnknowns unknowns_of(const Rigid3& pose) {
  const Eigen::Vector3d rotation = rotation_vector_of(pose.rotation), &t = pose.translation;
  return {{rotation.x(), rotation.y(), rotation.z(), t.x(), t.y(), t.z()}};
}

Rigid3 pose_of(const ViewUnknowns& view) {
  const auto& p = view.pose;
  return {rotation_by({p[0], p[1], p[2]}), {p[3], p[4], p[5]}};
}

using Kind = CameraFault::Kind;

// Each fault that there may be, of size 0.
std::vector<CameraFault> possible_faults(std::size_t views) {
  std::vector<CameraFault> faults(3, {Kind::bent_board});
  faults.push_back({Kind::stretched_board});
  for (std::size_t view = 0; view < views; ++view)
    for (const Kind kind : {Kind::zoom, Kind::centre, Kind::centre, Kind::rolling_shutter, Kind::rolling_shutter})
      faults.push_back({kind, view});
  return faults;
}
constexpr Eigen::Index board_faults = 4, view_faults = 5;

// Slopes of a residual by the faults of the board, then by those of its view.
Eigen::Matrix<double, 1, board_faults + view_faults> slopes_of(const EdgeCost& cost, const CameraUnknowns& c,
                                                               const ViewUnknowns& view, const Eigen::Vector2d& board_m,
                                                               double height_px) {
  const auto by_point = [&](const Eigen::Vector3d& step_m) {
    EdgeCost moved = cost;
    moved.point.point_m += step_m;
    return moved.residual(c, view) - cost.residual(c, view);
  };
  const Eigen::Vector2d at_px = cost.projected(c, view), at = 2 * cost.point.point_m.head<2>().cwiseQuotient(board_m);
  const Eigen::Vector2d& normal = cost.point.normal;
  const double row = at_px.y() / height_px, step = 1e-5;
  const auto bent = [&](double part) { return by_point({0, 0, step * part}) / step; };
  Eigen::Matrix<double, 1, board_faults + view_faults> slopes;
  slopes << bent(at.x() * at.x()), bent(at.x() * at.y()), bent(at.y() * at.y()),
      by_point({step * cost.point.point_m.x(), 0, 0}) / step, -normal.dot(at_px) / cost.sigma_px,
      -normal.x() / cost.sigma_px, -normal.y() / cost.sigma_px, -normal.x() * row / cost.sigma_px,
      -normal.y() * row / cost.sigma_px;
  return slopes;
}

using Costs = std::vector<std::vector<EdgeCost>>;  // by view

Departures departures_at(ceres::Problem& problem, const FittedNumbers& fitted, const Costs& costs,
                         const CameraUnknowns& c, const std::vector<ViewUnknowns>& views, double height_px) {
  Eigen::Vector2d board_m(1e-6, 1e-6);  // so that a size of a bent board is its sag
  for (const auto& view : costs)
    for (const EdgeCost& cost : view) board_m = board_m.cwiseMax(cost.point.point_m.head<2>().cwiseAbs());
  LinearFit fit = linear_fit(problem, fitted);
  fit.unmodelled_sigmas = unmodelled_sigmas, fit.most_seen = 12;
  Eigen::MatrixXd slopes =
      Eigen::MatrixXd::Zero(fit.residuals.size(), board_faults + view_faults * static_cast<Eigen::Index>(views.size()));
  Eigen::Index row = 0;
  for (std::size_t i = 0; i < costs.size(); ++i)
    for (const EdgeCost& cost : costs[i]) {
      const Eigen::RowVectorXd by =
          trust(cost.residual(c, views[i]), loss_scale_sigmas) * slopes_of(cost, c, views[i], board_m, height_px);
      slopes.row(row).head<board_faults>() = by.head(board_faults);
      slopes.row(row++).segment<view_faults>(board_faults + view_faults * static_cast<Eigen::Index>(i)) =
          by.tail(view_faults);
    }
  return departures_of(fit, slopes);
}

// Adds covariance and sigmas, by the noise that is there already; returns whether the fit determines them.
bool add_covariance(ceres::Problem& problem, const CameraUnknowns& c, const FittedNumbers& fitted,
                    const Eigen::MatrixXd& by_faults, CameraAdjustment& result) {
  const std::vector<const double*> blocks{&c.focal_px,         &c.aspect, c.centre_px.data(),
                                          c.distortion.data(), &c.k3,     c.magnifications.data()};
  const auto by_noise = covariance_of(problem, blocks);
  if (!by_noise) return false;
  const double scale = std::max(1.0, result.noise);
  Eigen::MatrixXd covariance = scale * scale * *by_noise;
  covariance += fitted.part_of(by_faults, blocks);
  if (!covariance.allFinite()) return false;
  result.sigma_aspect = std::sqrt(std::max(0.0, covariance(1, 1)));
  // From focal length and aspect to the two focal lengths.
  Eigen::MatrixXd change = Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols());
  change(1, 0) = c.aspect, change(1, 1) = c.focal_px;
  covariance = change * covariance * change.transpose();
  result.camera.covariance = covariance.topLeftCorner<9, 9>();
  const Eigen::VectorXd s = covariance.diagonal().cwiseMax(0).cwiseSqrt();
  result.camera.sigmas = {s[0], s[1], s[2], s[3], {s[4], s[5], s[6], s[7], s[8]}, s[9], s[10]};
  return true;
}

}  // namespace

std::array<CameraNumber, 11> numbers_of(Camera& camera) {
  auto& [k1, k2, p1, p2, k3] = camera.distortion;
  CameraSigmas& s = camera.sigmas;
  auto& k = s.distortion;
  ChromaticAberration& aberration = camera.chromatic_aberration;
  return {{{"fx [px]", camera.fx_px, s.fx_px},
           {"fy [px]", camera.fy_px, s.fy_px},
           {"cx [px]", camera.cx_px, s.cx_px},
           {"cy [px]", camera.cy_px, s.cy_px},
           {"k1", k1, k[0]},
           {"k2", k2, k[1]},
           {"p1", p1, k[2]},
           {"p2", p2, k[3]},
           {"k3", k3, k[4]},
           {"magnification of blue", aberration.blue, s.blue},
           {"magnification of red", aberration.red, s.red}}};
}

std::optional<CameraAdjustment> adjust_camera(const Camera& start, const std::vector<Rigid3>& camera_from_board,
                                              const std::vector<std::vector<EdgePoint>>& views,
                                              const CameraFreedom& freedom, const AtIteration& at_iteration) {
  CameraUnknowns camera = unknowns_of(start);
  if (!freedom.k3) camera.k3 = 0;
  if (!freedom.aspect) camera.aspect = 1;
  std::vector<ViewUnknowns> view_unknowns;
  for (const Rigid3& pose : camera_from_board) view_unknowns.push_back(unknowns_of(pose));

  ceres::Problem problem;
  std::vector<std::vector<EdgeCost>> costs(views.size());
  std::array<bool, channels> seen{};
  for (std::size_t i = 0; i < views.size(); ++i)
    for (const EdgePoint& point : views[i]) {
      costs[i].push_back({point, std::hypot(point.sigma_px, least_sigma_px)});
      seen[static_cast<std::size_t>(point.channel)] = true;
      costs[i].back().add_to(problem, camera, view_unknowns[i]);
    }
  problem.AddResidualBlock(new ceres::AutoDiffCostFunction<ShiftPrior, 4, 4>(new ShiftPrior), nullptr,
                           camera.shifts_px.data());
  if (!freedom.aspect) problem.SetParameterBlockConstant(&camera.aspect);
  if (!freedom.k3) problem.SetParameterBlockConstant(&camera.k3);
  if (!seen[0] || !seen[2]) problem.SetParameterBlockConstant(camera.magnifications.data());
  std::vector<int> fixed_channels;
  for (std::size_t c = 0; c < seen.size(); ++c)
    if (!seen[c]) fixed_channels.push_back(static_cast<int>(c));
  if (!fixed_channels.empty())
    for (ViewUnknowns& view : view_unknowns)
      if (problem.HasParameterBlock(view.wider_px.data()))
        problem.SetManifold(view.wider_px.data(), new ceres::SubsetManifold(channels, fixed_channels));

  if (!solve_quietly({ceres::SPARSE_SCHUR, 50, 1e-10}, problem, at_iteration).IsSolutionUsable()) return std::nullopt;

  CameraAdjustment result;
  result.camera = camera_of(camera, start);
  std::vector<double> in_sigmas;
  for (std::size_t i = 0; i < views.size(); ++i) {
    result.camera_from_board.push_back(pose_of(view_unknowns[i]));
    auto& residuals_px = result.residuals_px.emplace_back();
    for (const EdgeCost& cost : costs[i]) {
      in_sigmas.push_back(cost.residual(camera, view_unknowns[i]));
      residuals_px.push_back(in_sigmas.back() * cost.sigma_px);
    }
    for (std::size_t c = 0; c < channels; ++c)
      result.bright_wider_px[c] += view_unknowns[i].wider_px[c] / static_cast<double>(views.size());
  }
  FittedNumbers fitted(problem);
  for (double* block : {&camera.focal_px, &camera.aspect, camera.centre_px.data(), camera.distortion.data(), &camera.k3,
                        camera.magnifications.data(), camera.shifts_px.data()})
    fitted.add(block);
  for (ViewUnknowns& view : view_unknowns) fitted.add(view.pose.data()), fitted.add(view.wider_px.data());
  result.noise = robust_scale(std::move(in_sigmas));
  Eigen::MatrixXd by_faults = Eigen::MatrixXd::Zero(fitted.size(), fitted.size());
  if (freedom.faults) {
    const Departures departures = departures_at(problem, fitted, costs, camera, view_unknowns, start.height_px);
    result.faults = seen_of(departures, possible_faults(views.size()));
    by_faults = departures.by_seen + departures.by_instead;
  }
  if (!add_covariance(problem, camera, fitted, by_faults, result)) return std::nullopt;
  return result;
}

}  // namespace lapservo::internal
