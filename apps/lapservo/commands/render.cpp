#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "apps/lapservo/cli/interrupt.h"
#include "apps/lapservo/cli/output_folder.h"
#include "apps/lapservo/cli/progress.h"
#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/inputs/input_files.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/atomic_file.h"
#include "lapservo/core/error.h"
#include "lapservo/core/random.h"
#include "lapservo/io/image_file.h"
#include "lapservo/io/tables/configuration_csv.h"
#include "lapservo/io/video/video_writer.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/kinematics/features.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/kinematics/visibility.h"
#include "lapservo/sim/blood.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/renderer.h"
#include "lapservo/sim/tissue.h"

namespace lapservo::app {
using namespace internal;
namespace {
constexpr std::uintmax_t frames_bytes = 4 << 20;

struct RenderArguments {
  std::string rig, out, poses, background = "tissue", format = "png";
  int count = 20;
  std::uint64_t seed = 1;
  bool moving = false, video = false, force = false;
  double fps = 30, light = 1, smoke = 0, blood = 0, noise = 1, blur_px = 0.8, motion = 0, film_mm = 0.1;
};

// The truth.csv beside rendered frames: what is where, per frame and instrument. The columns of ../shared/frames.
constexpr auto truth_header =
    "file,instrument,condition,theta_rad,phi_rad,rho_m,psi_rad,tau_rad,e0_u_px,e0_v_px,e1_u_px,e1_v_px,e2_u_px,"
    "e2_v_px,e3_u_px,e3_v_px,s_rad,r_px,l_px,d_px,rcm_u_px,rcm_v_px\n";

// The instrument must have camera_from_rcm, and its marker lie before the camera (else std::invalid_argument).
std::string truth_row(const std::string& file, const Camera& camera, const Instrument& instrument,
                      const JointVector& q) {
  const Rigid3& camera_from_rcm = instrument.camera_from_rcm.value();
  const auto line = centre_line(camera, instrument.marker, camera_from_rcm * rcm_from_unrolled(q), q.psi_rad);
  const auto rcm_px = projected_rcm_px(camera, camera_from_rcm);
  if (!line || !rcm_px) throw std::invalid_argument("the marker does not lie before the camera");
  const Features f = features_of(line->ideal_px, rcm_px);
  std::string row = fmt::format("{},{},rendered,{:.7f},{:.7f},{:.7f},{:.7f},{:.7f}", file, instrument.name, q.theta_rad,
                                q.phi_rad, q.rho_m, q.psi_rad, line->tau_rad);
  for (const Eigen::Vector2d& ideal : line->ideal_px) {
    const Eigen::Vector2d raw = camera.raw_from_ideal(ideal);
    row += fmt::format(",{:.7f},{:.7f}", raw.x(), raw.y());
  }
  return row + fmt::format(",{:.7f},{:.7f},{:.7f},{:.7f},{:.7f},{:.7f}\n", f.s_rad, *f.r_px, f.l_px, f.d_px,
                           rcm_px->x(), rcm_px->y());
}

JointVector random_configuration(const Camera& camera, const Instrument& instrument, const std::string& rig,
                                 Random& random) {
  const ViewRange range{0.06, 0.14, {.steepest_rad = std::atan(1.2), .border_px = 0.02 * camera.width_px}};
  if (const auto q =
          random_configuration_in_view(camera, instrument.marker, *instrument.camera_from_rcm, range, random))
    return *q;
  throw InputError(
      rig, "instrument " + instrument.name + " is never wholly in view between 60 and 140 mm: check camera_from_rcm");
}

std::vector<Configurations> random_configurations(const Rig& rig, const RenderArguments& options) {
  Random random(options.seed);
  const int knots = options.moving ? std::max(2, options.count / 25 + 2) : options.count;
  std::vector<Configurations> drawn;
  for (int i = 0; i < knots; ++i) {
    Configurations frame;
    for (const Instrument& instrument : rig.instruments)
      frame.push_back(random_configuration(rig.camera, instrument, options.rig, random));
    drawn.push_back(std::move(frame));
  }
  if (!options.moving) return drawn;
  // From knot to knot with no speed at either.
  std::vector<Configurations> path;
  for (int i = 0; i < options.count; ++i) {
    const double place = (knots - 1.0) * i / std::max(1, options.count - 1);
    const auto knot = std::min(static_cast<std::size_t>(place), drawn.size() - 2);
    const double fraction = 0.5 - 0.5 * std::cos(pi * (place - static_cast<double>(knot)));
    Configurations frame;
    for (std::size_t k = 0; k < rig.instruments.size(); ++k)
      frame.push_back(
          JointVector::from_vector((1 - fraction) * drawn[knot][k].vector() + fraction * drawn[knot + 1][k].vector()));
    path.push_back(std::move(frame));
  }
  return path;
}

cv::Mat background_light(const Camera& camera, const RenderArguments& options) {
  if (options.background == "tissue") return make_tissue(camera.width_px, camera.height_px, options.seed);
  cv::Mat picture = read_image(options.background), scaled, light;
  cv::resize(picture, scaled, {camera.width_px, camera.height_px}, 0, 0, cv::INTER_AREA);
  cv::LUT(scaled, cv::Mat(camera.response.table()), light);
  return light;
}

Renderer make_renderer(const Rig& rig, const RenderArguments& options) {
  Random random(options.seed + 1);
  std::vector<ShaftModel> shafts;
  for (const Instrument& instrument : rig.instruments) {
    ShaftModel shaft = shaft_of(instrument);
    shaft.film_m = 1e-3 * options.film_mm;
    shaft.blotches = blood_over(instrument.marker, options.blood, random);
    shafts.push_back(std::move(shaft));
  }
  RenderOptions render;
  render.smoke = static_cast<float>(options.smoke);
  render.sensor.blur_px = options.blur_px;
  render.sensor.gains = Light::Constant(static_cast<float>(options.light));
  render.sensor.read_noise *= options.noise;
  render.sensor.shot_noise *= options.noise * options.noise;
  return Renderer(rig.camera, std::move(shafts), background_light(rig.camera, options), render);
}

// The moments of one exposure: from the configuration half a step back to half a step ahead.
Exposure exposure_of(const Rig& rig, const std::vector<Configurations>& frames, std::size_t index, double motion) {
  const int moments = motion > 0 ? 9 : 1;
  const Configurations &now = frames[index], &next = frames[std::min(index + 1, frames.size() - 1)];
  Exposure exposure;
  for (int m = 0; m < moments; ++m) {
    const double fraction = moments > 1 ? motion * (static_cast<double>(m) / (moments - 1) - 0.5) : 0;
    std::vector<ShaftPlacement> placements;
    for (std::size_t k = 0; k < now.size(); ++k)
      placements.push_back(
          placement_of(rig.instruments[k],
                       JointVector::from_vector(now[k].vector() + fraction * (next[k].vector() - now[k].vector()))));
    exposure.push_back(std::move(placements));
  }
  return exposure;
}

int run(const RenderArguments& options) {
  if (options.moving && !options.poses.empty())
    throw InputError("--moving", "is a path through random configurations, expected none with --poses");
  if (options.video && options.format != "png")
    throw InputError("--format", "is " + options.format + ", expected none with --video");
  const Rig rig = load_rig(options.rig);
  for (const Instrument& instrument : rig.instruments)
    if (!instrument.camera_from_rcm)
      throw InputError(options.rig, "instruments." + instrument.name + ".camera_from_rcm", "missing",
                       "a transform: it says where the instrument is");
  InputFiles inputs;
  inputs.add_rig(options.rig, rig);
  inputs.add(options.poses);
  inputs.add(options.background);
  OutputFolder folder(options.out, rig, inputs, options.force, frames_bytes);
  const auto frames =
      options.poses.empty() ? random_configurations(rig, options) : read_configurations(options.poses, rig);
  Renderer renderer = make_renderer(rig, options);
  AtomicFile truth(folder / "truth.csv");
  truth.stream() << truth_header;
  std::optional<VideoWriter> video;
  if (options.video) video.emplace(folder / "video.mp4", options.fps, VideoUse::measured);
  watch_for_interrupts();
  {
    Progress progress(static_cast<int>(frames.size()));
    for (std::size_t i = 0; i < frames.size(); ++i) {
      if (interrupted()) throw InputError(options.out, "was interrupted: nothing is written");
      const std::string name = fmt::format("{:04}.{}", i, options.format);
      for (std::size_t k = 0; k < rig.instruments.size(); ++k) {
        try {
          truth.stream() << truth_row(name, rig.camera, rig.instruments[k], frames[i][k]);
        } catch (const std::invalid_argument& error) {
          throw InputError(options.poses, fmt::format("frame {}: {}", i, error.what()));
        }
      }
      const cv::Mat image = renderer.render_exposure(exposure_of(rig, frames, i, options.motion), options.seed + i);
      if (video) {
        video->add(image);
      } else {
        write_image(folder / name, image);
      }
      progress.show(static_cast<int>(i) + 1, "");
    }
  }
  if (video) video->commit();
  truth.commit();
  folder.commit();
  std::printf("%zu frames with truth.csv and rig.yaml: %s\n", frames.size(), options.out.c_str());
  if (video && !video_remark().empty()) std::printf("the video is %s\n", video_remark().c_str());
  return 0;
}

}  // namespace

void add_render(Command app) {
  auto [command, options] =
      app.add_subcommand<RenderArguments>("render", "Render frames of a rig with exact truth.", run);
  command.add_option("--rig", options.rig, required(), "Camera and instruments, with camera_from_rcm");
  command.add_option("--out", options.out, required(),
                     std::string("Folder for NNNN.png, truth.csv and rig.yaml") + OutputFolder::help);
  command.add_option("--poses", options.poses,
                     "CSV of theta_rad, phi_rad, rho_m, psi_rad (and instrument), a row a frame and instrument; else "
                     "random ones in view");
  command.add_option("--count", options.count, whole_between(1, 100000), "How many random configurations");
  command.add_option("--seed", options.seed, seed_number(), "Seed of configurations, background and noise");
  command.add_flag("--moving", options.moving, "A smooth path through random configurations");
  command.add_option("--background", options.background, "An image, or tissue");
  command.add_option("--light", options.light, between(0.01, 10.0), "Exposure, 1 is normal");
  command.add_option("--smoke", options.smoke, between(0.0, 1.0), "Share of grey veil, 0 to 1");
  command.add_option("--blood", options.blood, between(0.0, 0.9), "Share of the marker covered, 0 to 0.9");
  command.add_option("--noise", options.noise, between(0.0, 20.0), "Times the sensor's usual noise");
  command.add_option("--blur-px", options.blur_px, between(0.0, 20.0), "Sigma of the optical blur");
  command.add_option("--motion", options.motion, between(0.0, 1.0),
                     "Motion blur: fraction of the step to the next frame, 0 to 1");
  command.add_option("--film-mm", options.film_mm, between(0.0, 1.0), "Thickness of the film that carries the marker");
  command.add_option("--format", options.format, one_of({"png", "jpg"}), "png or jpg");
  command.add_flag("--video", options.video, "Write video.mp4 instead of images");
  command.add_option("--fps", options.fps, between(0.1, 1000.0), "Frame rate of the video");
  command.add_flag("--force", options.force, OutputFolder::force_help);
  command.footer("Example:\n  lapservo render --rig configs/example.yaml --out frames --count 50 --moving --blood 0.2");
}

}  // namespace lapservo::app
