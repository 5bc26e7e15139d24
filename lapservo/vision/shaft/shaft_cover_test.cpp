#include "lapservo/vision/shaft/shaft_cover.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/testing/scenes.h"

namespace lapservo::internal::shaft_cover_test {

// The marker's pixels, and where it is.
struct Covered {
  const scenes::Shot& shot;
  ShaftPose pose = scenes::pose_of(shot.rig, 0, shot.q);
  Scene scene = shot.sight.scene();
  std::vector<Blob> blobs = largest_blobs(shot.sight.view(), shot.sight.classes());
  ShaftCover cover{scene.camera, scene.marker, scene.bands, pose};

  explicit Covered(std::uint64_t seed) : shot(scenes::usual_shot(seed)) {}
};

TEST(ShaftCover, ExplainsTheMarkersPixels) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    SCOPED_TRACE(seed);
    const Covered it(seed);
    ASSERT_FALSE(it.blobs.empty());
    std::size_t explained = 0;
    for (const Blob::Sample& sample : it.blobs[0].samples)
      explained += it.cover.explains(Eigen::Vector2d(sample.u, sample.v), sample.colour);
    EXPECT_GT(static_cast<double>(explained), 0.95 * static_cast<double>(it.blobs[0].samples.size()));
    EXPECT_FALSE(it.cover.lies_beside(it.blobs[0], it.scene.bands));
  }
}

TEST(ShaftCover, LeavesWhatLiesBesideIt) {
  Covered it(1);
  Blob beside = it.blobs[0];
  const auto middle_px = it.scene.camera.raw_from_point(it.pose.camera_from_unrolled *
                                                        Eigen::Vector3d(0, 0, 1.8 * it.scene.marker.length_m()));
  for (Blob::Sample& sample : beside.samples)
    sample.u = static_cast<int>(middle_px.x()), sample.v = static_cast<int>(middle_px.y());
  const ShaftCover* cover = &it.cover;
  EXPECT_EQ(without({beside}, {&cover, 1}).size(), 1U);
  EXPECT_TRUE(it.cover.lies_beside(beside, it.scene.bands));
  for (Blob::Sample& sample : beside.samples) sample.colour = 200;
  EXPECT_FALSE(it.cover.lies_beside(beside, it.scene.bands)) << "others' colours";
}

TEST(ShaftCover, HidesWhatLiesBehindIt) {
  const Covered it(2);
  for (const double along : {-0.5, 0.2, 0.8}) {
    const Eigen::Vector3d point =
        it.pose.camera_from_unrolled * Eigen::Vector3d(0, 0, along * it.scene.marker.length_m());
    EXPECT_TRUE(it.cover.hides(1.1 * point)) << along;
    EXPECT_FALSE(it.cover.hides(0.9 * point)) << along;
    const double aside_m = 400 / it.scene.camera.fx_px * point.z();
    EXPECT_FALSE(it.cover.hides(1.1 * (point + Eigen::Vector3d(aside_m, aside_m, 0)))) << along;
  }
}

// A lens's distortion is a polynomial that folds far places back into the image.
TEST(ShaftCover, LiesUnderTheShaftAloneWhateverTheLens) {
  for (const double k1 : {0.0, -0.1, -0.3, 0.2}) {
    SCOPED_TRACE(k1);
    Rig rig = scenes::usual_rig();
    rig.camera.distortion = {k1, k1 < -0.2 ? 0.1 : 0, 0, 0, 0};
    Random random(4);
    const Marker& marker = rig.instruments[0].marker;
    const ShaftPose pose = scenes::pose_of(rig, 0, scenes::random_configuration(rig, 0, random));
    const ShaftCover cover(rig.camera, marker, {1, 2, 3}, pose);
    const Rigid3 shaft_from_camera = pose.camera_from_unrolled.inverse();
    int covered = 0, far = 0;
    for (int v = 2; v < rig.camera.height_px; v += 4)
      for (int u = 2; u < rig.camera.width_px; u += 4) {
        const Eigen::Vector2d px(u, v);
        if (!cover.explains(px, 1) && !cover.explains(px, 2) && !cover.explains(px, 3)) continue;
        ++covered;
        const Eigen::Vector3d ray = rig.camera.ray_from_ideal(rig.camera.ideal_from_raw(px).value());
        const Eigen::Vector3d eye = shaft_from_camera.translation, way = shaft_from_camera.rotation * ray;
        const Eigen::Vector2d across = way.head<2>().normalized();
        const double apart_m = std::abs(across.x() * eye.y() - across.y() * eye.x());
        far += apart_m > 1.5 * marker.radius_m();
      }
    EXPECT_GT(covered, 300);
    EXPECT_LT(far, covered / 100 + 3);
  }
}

TEST(ShaftCover, MayMeetOnlyWhatIsNear) {
  const Rig rig = scenes::usual_rig(2);
  Random random(1);
  const scenes::CrossingPair pair = scenes::crossing_pair(rig, random);
  const ShaftPose first = scenes::pose_of(rig, 0, pair.q[0]);
  const ShaftPose other = scenes::pose_of(rig, 1, pair.q[1]);
  const Marker& marker = rig.instruments[0].marker;
  const ShaftCover cover(rig.camera, marker, {1, 2, 3}, other);
  EXPECT_TRUE(cover.may_meet(marker, first));
  ShaftPose beside = first;
  const Eigen::Vector3d axis = first.camera_from_unrolled.rotation * Eigen::Vector3d::UnitZ();
  beside.camera_from_unrolled.translation +=
      5 * marker.diameter_m * axis.cross(first.camera_from_unrolled.translation).normalized();
  EXPECT_FALSE(ShaftCover(rig.camera, marker, {1, 2, 3}, beside).may_meet(marker, first));
}

}  // namespace lapservo::internal::shaft_cover_test
