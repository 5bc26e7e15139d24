#include "acceptance/frame_sets.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <numeric>
#include <stdexcept>

#include <opencv2/videoio.hpp>

#include "lapservo/core/angles.h"
#include "lapservo/core/csv.h"
#include "lapservo/core/random.h"
#include "lapservo/io/frame_source.h"
#include "lapservo/io/image_file.h"
#include "lapservo/io/video/video_writer.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/kinematics/visibility.h"
#include "lapservo/sim/instrument_shaft.h"
#include "lapservo/sim/tissue.h"
#include "lapservo/testing/sample_frames.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo::acceptance {
using namespace internal;
namespace fs = std::filesystem;

double mean(const std::vector<double>& values) {
  return values.empty() ? 0 : std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}
double standard_deviation(const std::vector<double>& values) {
  const double middle = mean(values), square = rms(values);
  return std::sqrt(std::max(0.0, square * square - middle * middle));
}
double largest(const std::vector<double>& values) {
  double most = 0;
  for (const double value : values) most = std::max(most, std::abs(value));
  return most;
}

Truth truth_of(const Rig& rig, std::size_t index, const JointVector& q) {
  const Instrument& instrument = rig.instruments[index];
  const auto line =
      centre_line(rig.camera, instrument.marker, *instrument.camera_from_rcm * rcm_from_unrolled(q), q.psi_rad).value();
  Truth truth{instrument.name, "rendered", q, line.tau_rad, {}};
  for (std::size_t k = 0; k < 4; ++k) truth.edges_raw_px[k] = rig.camera.raw_from_ideal(line.ideal_px[k]);
  return truth;
}

void Score::add(const TrueFrame& frame, const std::vector<Observation>& observations) {
  for (const Truth& truth : frame.truths) {
    const auto named = std::find_if(frame.rig.instruments.begin(), frame.rig.instruments.end(),
                                    [&](const Instrument& i) { return i.name == truth.instrument; });
    const Observation& o = observations.at(static_cast<std::size_t>(named - frame.rig.instruments.begin()));
    ++expected;
    if (o.status != Status::ok || !o.rcm) {
      ++refusals[std::string(to_string(o.status))];
      continue;
    }
    ++found;
    const double error_rad = wrap_pi(o.rcm->q.psi_rad - truth.q.psi_rad);
    wrong += std::abs(error_rad) > 0.1;
    psi_rad.push_back(error_rad);
    theta_rad.push_back(wrap_pi(o.rcm->q.theta_rad - truth.q.theta_rad));
    phi_rad.push_back(o.rcm->q.phi_rad - truth.q.phi_rad);
    rho_m.push_back(o.rcm->q.rho_m - truth.q.rho_m);
    const Eigen::Vector4d sigmas = o.rcm->covariance.diagonal().cwiseSqrt();
    theta_sigmas.push_back(theta_rad.back() / sigmas[0]);
    phi_sigmas.push_back(phi_rad.back() / sigmas[1]);
    rho_sigmas.push_back(rho_m.back() / sigmas[2]);
    psi_sigmas.push_back(error_rad / sigmas[3]);
    for (std::size_t k = 0; k < 4; ++k) edge_px.push_back((o.edges_raw_px[k] - truth.edges_raw_px[k]).norm());
    edges.push_back(o.edges_raw_px);
  }
}

namespace {

std::vector<TrueFrame> frames_in(const fs::path& folder) {
  const CsvTable table = CsvTable::read(folder / "truth.csv");
  std::vector<TrueFrame> frames;
  std::string last_file;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const std::string& file = table.text(row, "file");
    if (file != last_file) {
      const fs::path own = folder / fs::path(file).replace_extension(".rig.yaml");
      TrueFrame frame;
      frame.rig = load_rig(fs::exists(own) ? own : folder / "rig.yaml");
      if (fs::exists(folder / file)) frame.bgr = read_image(folder / file);
      frames.push_back(std::move(frame));
      last_file = file;
    }
    Truth truth{table.text(row, "instrument"), table.text(row, "condition"), {}, table.number(row, "tau_rad"), {}};
    truth.q = {table.number(row, "theta_rad"), table.number(row, "phi_rad"), table.number(row, "rho_m"),
               table.number(row, "psi_rad")};
    for (std::size_t k = 0; k < 4; ++k) {
      const std::string e = "e" + std::to_string(k);
      truth.edges_raw_px[k] = {table.number(row, e + "_u_px"), table.number(row, e + "_v_px")};
    }
    frames.back().truths.push_back(truth);
  }
  return frames;
}

}  // namespace

std::vector<TrueFrame> sample_frames(const std::string& set) {
  return frames_in(lapservo::testing::sample_frames(set).value());
}

std::vector<TrueFrame> stored_frames(const std::string& set) {
  return frames_in(lapservo::testing::source_folder() / "acceptance/frames" / set);
}

Score score_single(const std::vector<TrueFrame>& frames) {
  Score score;
  for (const TrueFrame& frame : frames)
    score.add(frame, Tracker(frame.rig, {.method = Method::surface, .single = true}).track(frame.bgr));
  return score;
}

Rig example_rig() {
  return load_rig(lapservo::testing::source_folder() / "configs/example.yaml");
}

namespace {

std::vector<Blotch> blotches(const Marker& marker, double fraction, Random& random) {
  std::vector<Blotch> discs;
  for (double covered = 0; covered < fraction;) {
    const double radius_m = random.uniform(0.08, 0.22) * marker.diameter_m;
    discs.push_back({random.uniform(0, two_pi), random.uniform(0, marker.length_m()), radius_m});
    covered += pi * radius_m * radius_m / (pi * marker.diameter_m * marker.length_m());
  }
  return discs;
}

}  // namespace

std::vector<TrueFrame> rendered_frames(const RenderedSet& set) {
  const Rig& rig = set.rig;
  std::vector<TrueFrame> frames;
  const cv::Mat tissue = make_tissue(rig.camera.width_px, rig.camera.height_px, set.seed);
  Random random(set.seed);
  std::vector<ShaftModel> shafts;
  for (const Instrument& instrument : rig.instruments) {
    ShaftModel shaft = shaft_of(instrument);
    shaft.blotches = blotches(instrument.marker, set.blood, random);
    shaft.shaft_reflectance = set.shaft_reflectance;
    shafts.push_back(shaft);
  }
  Renderer renderer(rig.camera, shafts, tissue, set.options);
  for (std::size_t f = 0; f < set.configurations.size(); ++f) {
    TrueFrame frame{rig, {}, {}};
    const auto& now = set.configurations[f];
    std::vector<ShaftPlacement> placed;
    for (std::size_t i = 0; i < now.size(); ++i) placed.push_back(placement_of(rig.instruments[i], now[i]));
    frame.bgr = renderer.render(placed, set.seed * 1000 + f);
    if (set.after) frame.bgr = set.after(frame.bgr);
    for (std::size_t i = 0; i < now.size(); ++i) frame.truths.push_back(truth_of(rig, i, now[i]));
    frames.push_back(std::move(frame));
  }
  return frames;
}

namespace {

// The command as anybody would call it: its chroma is sited where its scaler puts it.
const std::map<Encoder, std::string> ffmpeg_options{
    {Encoder::ffmpeg, "libx264 -crf 16 -pix_fmt yuv420p"},
    {Encoder::x265, "libx265 -x265-params log-level=none -pix_fmt yuv420p"},
    {Encoder::x265_rgb, "libx265 -x265-params log-level=none"}};
void record_by_ffmpeg(const std::vector<TrueFrame>& frames, const std::string& codec, const fs::path& path) {
  const cv::Size size = frames.at(0).bgr.size();
  const std::string command = "ffmpeg -v error -f rawvideo -pix_fmt bgr24 -r 30 -s " + std::to_string(size.width) +
                              "x" + std::to_string(size.height) + " -i - -c:v " + codec + " " + path.string();
  FILE* const to = popen(command.c_str(), "w");
  if (to == nullptr) throw std::runtime_error("ffmpeg can't be started");
  bool written = true;
  for (const TrueFrame& frame : frames)
    written = written &&
              std::fwrite(frame.bgr.clone().data, frame.bgr.elemSize(), frame.bgr.total(), to) == frame.bgr.total();
  if (pclose(to) != 0 || !written) throw std::runtime_error("failed (installed?): " + command);
}

}  // namespace

void compress(std::vector<TrueFrame>& frames, Encoder encoder) {
  const testing::TemporaryFolder folder;
  const auto path = folder.path() / "frames.mp4";
  if (encoder == Encoder::lapservo) {
    VideoWriter writer(path, 30);
    for (const TrueFrame& frame : frames) writer.add(frame.bgr);
    writer.commit();
  } else if (encoder != Encoder::opencv) {
    record_by_ffmpeg(frames, ffmpeg_options.at(encoder), path);
  } else {
    // cv::VideoWriter's own choice is MPEG-4 part 2.
    cv::VideoWriter writer(path.string(), cv::CAP_FFMPEG, cv::VideoWriter::fourcc('a', 'v', 'c', '1'), 30,
                           frames.at(0).bgr.size());
    if (!writer.isOpened()) throw std::runtime_error("no encoder of H.264");
    for (const TrueFrame& frame : frames) writer.write(frame.bgr);
  }
  const auto video = open_frame_source(path.string(), 30);
  for (TrueFrame& frame : frames) frame.bgr = video->next().value().bgr.clone();
}

std::vector<std::vector<JointVector>> random_configurations(const Rig& rig, int count, std::uint64_t seed,
                                                            double steepest_rad) {
  Random random(seed);
  const ViewRange range{0.075, 0.12, {steepest_rad, 40}};
  std::vector<std::vector<JointVector>> configurations;
  for (int frame = 0; frame < count; ++frame) {
    std::vector<JointVector> of_frame;
    for (const Instrument& i : rig.instruments)
      of_frame.push_back(random_configuration_in_view(rig.camera, i.marker, *i.camera_from_rcm, range, random).value());
    configurations.push_back(of_frame);
  }
  return configurations;
}

}  // namespace lapservo::acceptance
