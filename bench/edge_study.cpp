#include <cmath>
#include <cstdio>

#include "bench/accuracy_study.h"
#include "lapservo/core/statistics.h"
#include "lapservo/testing/sample_frames.h"
#include "lapservo/testing/scenes.h"
#include "lapservo/vision/model/fine_fit.h"

namespace lapservo::bench {
namespace {
using namespace acceptance;
using namespace internal;

// Root mean squares over frames [px].
struct EdgeErrors {
  std::vector<double> whole, single, noise, neighbours;  // neighbours: products of a point's and the next one's error

  void print() const {
    std::printf(" %.4f | %.4f | %.4f | %+.2f |", rms(whole), rms(single), rms(noise),
                mean(neighbours) / std::pow(rms(single), 2));
  }
};

// One boundary's or side's, in the order in which it was located.
void add(const EdgeMeasurements& edges, std::size_t group, double floor_px, EdgeErrors& errors) {
  constexpr double farthest_px = 1;  // else it is no point of this edge
  constexpr std::size_t fewest = 8;
  std::vector<double> residuals_px;
  for (const Measurement& m : edges.all) {
    if (m.group != group || std::abs(m.residual_px) > farthest_px) continue;
    residuals_px.push_back(m.residual_px);
    errors.noise.push_back(std::sqrt(std::max(0.0, m.sigma_px * m.sigma_px - floor_px * floor_px)));
  }
  if (residuals_px.size() < fewest) return;
  const double whole_px = mean(residuals_px);
  errors.whole.push_back(whole_px);
  for (std::size_t i = 0; i < residuals_px.size(); ++i) {
    errors.single.push_back(residuals_px[i] - whole_px);
    if (i > 0) errors.neighbours.push_back((residuals_px[i] - whole_px) * (residuals_px[i - 1] - whole_px));
  }
}

void print_errors(const std::string& name, const std::vector<TrueFrame>& frames) {
  constexpr Effort effort{2, 0, 3, 1};
  EdgeErrors boundaries, sides;
  std::vector<double> radii_px;
  for (const TrueFrame& frame : frames) {
    const scenes::Sight sight(frame.rig, frame.bgr);
    const PoseUnknowns truth(pose_through_rcm(*frame.rig.instruments[0].camera_from_rcm, frame.truths[0].q), true);
    const FineFit fit = fit_finely(sight.scene(), sight.light(), truth, {});
    if (!fit.converged) continue;
    const EdgeMeasurements edges = measure_edges(sight.scene(), sight.light(), truth, film_mean_m, effort, fit.blur);
    radii_px.push_back(edges.radius_px);
    for (std::size_t group = 0; group < measurement_groups; ++group)
      group < 4 ? add(edges, group, edge_limits.single_floor_px, boundaries)
                : add(edges, group, edge_limits.side_floor_px, sides);
  }
  std::printf("| %s | %zu | %.0f |", name.c_str(), radii_px.size(), mean(radii_px));
  boundaries.print();
  sides.print();
  std::printf("\n");
}

}  // namespace

void print_edge_errors(int frames, std::uint64_t seed) {
  std::puts(
      "| | frames | radius [px] | boundary: whole | single | light's noise | lag-1 | side: whole | single | light's "
      "noise | lag-1 |");
  std::puts("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
  for (const char* name : {"still", "5mm", "3mm", "soft_dim"}) print_errors(name, motion_frames(name, frames, seed));
  if (testing::sample_frames())
    for (const char* set : {"rotation", "illumination"})
      print_errors(std::string("samples, ") + set, sample_frames(set));
}

}  // namespace lapservo::bench
