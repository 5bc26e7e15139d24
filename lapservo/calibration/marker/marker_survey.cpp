#include "lapservo/calibration/marker/marker_survey.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <opencv2/imgproc.hpp>

#include "lapservo/core/statistics.h"
#include "lapservo/vision/decision/verification.h"
#include "lapservo/vision/image/light_image.h"
#include "lapservo/vision/search/coarse_fit.h"
#include "lapservo/vision/search/starts.h"

namespace lapservo::internal {
namespace {

// An error of half a millimetre in the print leaves nine tenths of the surface with the colour that the rig's would
// have.
constexpr double min_matching = 0.6, max_wrong = 0.15;
// Where boundaries are measured, what blurs luma is light's blur: libx264 hardly blurs it after the response, but a fit
// of its wide and ragged blur of colour differences takes some, and then moves e2 by 0.155 px for 0.1. A gradient of
// light is taken for none: of a turn they cancel, and what a fit of one video frame gives for it moves boundaries by
// more than it does (psi by -2.5 mrad).
constexpr ExpectedPicture expected_picture{.least_sharpening = 0, .gradient_sigma_per_px = 0.002};
// In a video of a plain camera's images light's blur and its gradient come out right: 0.85 px for 0.85.
constexpr ExpectedPicture expected_video{.least_sharpening = 0, .gradient_sigma_per_px = 0.01, .only_video = true};

// Without colour differences, which videos blur far more than luma.
cv::Mat grey_of(const cv::Mat& bgr) {
  cv::Mat luma, grey;
  cv::cvtColor(bgr, luma, cv::COLOR_BGR2GRAY);
  cv::cvtColor(luma, grey, cv::COLOR_GRAY2BGR);
  return grey;
}

// The sides as another image of the same shows them. Boundaries come first, so what is known of measurements by their
// place stays true.
void take_sides(const EdgeMeasurements& from, EdgeMeasurements& edges) {
  decltype(edges.all) all;
  for (const Measurement& m : edges.all)
    if (m.group < 4) all.push_back(m);
  for (const Measurement& m : from.all)
    if (m.group >= 4) all.push_back(m);
  edges.all = all;
  edges.sides_in_image = from.sides_in_image;
  edges.side_blur = from.side_blur;
}

std::optional<Sighting> sighting_of(const Scene& scene, const PoseUnknowns& unknowns, const EdgeBlur& blur,
                                    bool settled, const CameraDeparture& departure) {
  const ShaftPose& pose = unknowns.pose();
  const auto tau_rad = facing_tau_rad(scene.marker, pose);
  if (!tau_rad) return std::nullopt;
  const ColourAgreement agreement = colour_agreement(scene, pose);
  if (agreement.in_image < 0.9 || agreement.matching < min_matching || agreement.wrong > max_wrong) return std::nullopt;
  return Sighting{unknowns, blur, film_mean_m, *tau_rad, settled, departure};
}

// The fine fit where it settles, else the coarse one.
std::optional<Sighting> refined(const Scene& scene, const LightImage& light, const CoarseFit& coarse,
                                const EdgeBlur& blur, const CameraDeparture& departure) {
  const FineFit fine = fit_finely(scene, light, coarse.unknowns, {.blur = blur, .departure = departure});
  if (fine.converged)
    if (auto sighting = sighting_of(scene, fine.as_the_rig_says, fine.blur, true, fine.departure)) return sighting;
  return sighting_of(scene, coarse.unknowns, blur, false, departure);
}

}  // namespace

std::optional<Sighting> MarkerSurvey::follow(const Scene& scene, const LightImage& light) const {
  const CoarseFit coarse = fit_coarsely(scene, last_->unknowns, Rotation::known);
  if (!coarse.found) return std::nullopt;
  auto sighting = refined(scene, light, coarse, last_->blur, last_->departure);
  return sighting && sighting->settled ? sighting : std::nullopt;
}

std::optional<Sighting> MarkerSurvey::detect(const Scene& scene, const LightImage& light) const {
  const auto blobs = largest_blobs(scene.image, classes_);
  std::optional<Sighting> best;
  double best_score = 0;
  const auto try_start = [&](const PoseUnknowns& start) {
    const CoarseFit coarse = fit_coarsely(scene, start.with_rcm(false), Rotation::unknown);
    if (!coarse.shows_rotation() || coarse.has_rival()) return;
    const auto sighting = refined(scene, light, coarse, {}, {});
    if (!sighting) return;
    const double score = colour_agreement(scene, sighting->unknowns.pose()).matching + sighting->settled;
    if (score > best_score) best_score = score, best = sighting;
  };
  const auto& camera_from_rcm = rig_.instruments[instrument_].camera_from_rcm;
  for (const Blob& blob : blobs) {
    if (camera_from_rcm)
      for (const PoseUnknowns& start : starts_in(scene, blob, camera_from_rcm).poses) try_start(start);
    if (!best || !best->settled)
      for (const PoseUnknowns& start : starts_in(scene, blob, std::nullopt).poses) try_start(start);
    if (best && best->settled) break;
  }
  return best;
}

std::optional<Sighting> MarkerSurvey::find(const cv::Mat& bgr) {
  const ImageView image(bgr);
  const LightImage light(image, light_, ChannelGeometry(rig_.camera));
  const Scene scene{image, rig_.camera, classes_, rig_.instruments[instrument_].marker, classes_.of_bands(instrument_)};
  auto sighting = last_ ? follow(scene, light) : std::nullopt;
  if (!sighting) sighting = detect(scene, light);
  last_ = sighting;
  return sighting;
}

std::optional<MarkerView> cropped_view(const cv::Mat& bgr, const Camera& camera, const Marker& marker,
                                       const Rigid3& camera_from_unrolled) {
  constexpr double room_m = 3e-3;
  const double reach_m = marker.radius_m() + room_m;
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e9), high = -low;
  for (const double along_m : {-room_m, marker.length_m() + room_m})
    for (const double x : {-reach_m, reach_m})
      for (const double y : {-reach_m, reach_m}) {
        const Eigen::Vector3d corner = camera_from_unrolled * Eigen::Vector3d(x, y, along_m);
        if (!(corner.z() > 1e-3)) return std::nullopt;
        const Eigen::Vector2d px = camera.raw_from_point(corner);
        low = low.cwiseMin(px), high = high.cwiseMax(px);
      }
  const auto cut = [](double px, int end) { return static_cast<int>(std::clamp(px, 0.0, static_cast<double>(end))); };
  const cv::Point from(cut(std::floor(low.x()), camera.width_px), cut(std::floor(low.y()), camera.height_px));
  const cv::Point to(cut(std::ceil(high.x()) + 1, camera.width_px), cut(std::ceil(high.y()) + 1, camera.height_px));
  constexpr int min_px = 8;
  if (to.x - from.x < min_px || to.y - from.y < min_px) return std::nullopt;
  MarkerView view{bgr(cv::Rect(from, to)).clone(), camera};
  view.camera.width_px = to.x - from.x, view.camera.height_px = to.y - from.y;
  view.camera.cx_px -= from.x, view.camera.cy_px -= from.y;
  return view;
}

void take_processing_off(std::vector<ViewMeasurements>& views) {
  constexpr std::size_t groups = 4;
  std::array<std::vector<double>, groups> told_px;
  std::ptrdiff_t asked = 0;
  for (const ViewMeasurements& view : views) {
    if (view.processing.processing != Processing::unknown) ++asked;
    if (!view.processing.edges) continue;
    for (std::size_t k = 0; k < groups; ++k)
      if (const auto bias_px = view.processing.edges->bias_px[k]) told_px[k].push_back(*bias_px);
  }
  std::array<double, groups> usual_px{};
  for (std::size_t k = 0; k < groups; ++k)
    if (2 * std::ssize(told_px[k]) > asked) usual_px[k] = median(told_px[k]);
  for (ViewMeasurements& view : views) {
    if (view.processing.processing == Processing::none) continue;
    view.bias_px = usual_px;
    if (view.processing.edges)
      for (std::size_t k = 0; k < groups; ++k)
        view.bias_px[k] = view.processing.edges->bias_px[k].value_or(usual_px[k]);
    for (Measurement& m : view.edges.all)
      if (m.group < groups) m.residual_px -= view.bias_px[m.group];
  }
}

bool shows_only_video(const std::vector<ViewMeasurements>& any, const std::vector<ViewMeasurements>& only_video) {
  constexpr double max_misfit = 1.1;  // of the one with every processing
  // Where they are blurred less (1.2 px^2 by lapservo's own writer, 2.0 by OpenCV's), colours say more than luma alone.
  constexpr double min_chroma_variance_px2 = 1.6;
  std::vector<double> misfits, variances_px2;
  for (std::size_t i = 0; i < std::min(any.size(), only_video.size()); ++i)
    if (const auto& a = any[i].processing.edges, &b = only_video[i].processing.edges; a) {
      misfits.push_back(b ? b->misfit / a->misfit : 2 * max_misfit);
      variances_px2.push_back(b ? b->processing.chroma_variance_px2 : 0);
    }
  return 2 * misfits.size() > any.size() && median(misfits) < max_misfit &&
         median(variances_px2) > min_chroma_variance_px2;
}

ViewMeasurements ViewMeasurer::measure(const MarkerView& view, const Marker& marker, const Sighting& sighting,
                                       const Reach& reach) const {
  constexpr int iterations = 6;
  const ImageView image(view.bgr);
  const LightImage as_the_rig_says(image, light_, ChannelGeometry(view.camera));
  const DepartedLight seen(as_the_rig_says, sighting.departure);
  const LightImage& light = seen.light();
  const Scene scene{image, view.camera, classes_, marker, bands_};
  ViewMeasurements measured;
  const auto edges_in = [&](const Scene& of, const LightImage& by) {
    return measure_edges(of, by, sighting.unknowns, sighting.film_m, {reach.extra_px, reach.extra_px, iterations, 1},
                         sighting.blur);
  };
  measured.edges = edges_in(scene, light);
  if (reach.ask_processing)
    measured.processing = find_processing(light, measured.edges.all, sighting.blur.boundaries_px(),
                                          reach.only_video ? expected_video : expected_picture);
  const auto& found = measured.processing.edges;
  const auto processing = found ? std::optional(found->processing) : std::nullopt;
  const auto seam_by = [&](const LightImage* grey) {
    return measure_seam(scene, light, sighting.unknowns, sighting.blur.boundaries_px(), reach.seam_m, reach.free_gap,
                        processing, grey);
  };
  if (processing) {
    const cv::Mat grey = grey_of(view.bgr);
    const ImageView grey_image(grey);
    const LightImage grey_light(grey_image, light.light_of_value());
    const Scene grey_scene{grey_image, view.camera, classes_, marker, bands_};
    take_sides(edges_in(grey_scene, grey_light), measured.edges);
    measured.seam = seam_by(reach.only_video ? &grey_light : nullptr);
  } else {
    measured.seam = seam_by(nullptr);
  }
  measured.blur_px = std::max(sighting.blur.boundaries_px(), sighting.blur.sides_px);
  measured.film_m = sighting.film_m;
  return measured;
}

std::optional<Sighting> ViewMeasurer::settled(const MarkerView& view, const Marker& marker,
                                              const Sighting& sighting) const {
  const ImageView image(view.bgr);
  const LightImage light(image, light_, ChannelGeometry(view.camera));
  const Scene scene{image, view.camera, classes_, marker, bands_};
  const FineFit fine =
      fit_finely(scene, light, sighting.unknowns, {.blur = sighting.blur, .departure = sighting.departure});
  return fine.converged ? sighting_of(scene, fine.as_the_rig_says, fine.blur, true, fine.departure) : std::nullopt;
}

}  // namespace lapservo::internal
