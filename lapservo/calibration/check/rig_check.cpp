#include "lapservo/calibration/check/rig_check.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <map>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lapservo/calibration/check/frame_diagnosis.h"
#include "lapservo/calibration/registration/arm_start.h"
#include "lapservo/calibration/registration/axes_meeting_point.h"
#include "lapservo/calibration/registration/registration.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/statistics.h"
#include "lapservo/marker/sensitivity.h"
#include "lapservo/vision/colour/colour_classes.h"

namespace lapservo::internal {
namespace {

// psi's error by another print than the rig's, over the turn, without its mean, which the arm's offset of psi takes.
Told psi_by_print(const Marker& rig, const Marker& measured) {
  constexpr int steps = 72;
  double sum = 0, squares = 0, variance = 0;
  for (int i = 0; i < steps; ++i) {
    const double tau_rad = (i + 0.5) / steps * std::min(rig.covered_rad(), measured.covered_rad());
    const auto by_boundaries = tau_by_boundaries(rig, tau_rad);
    const auto is = boundaries_m(measured, tau_rad), believed = boundaries_m(rig, tau_rad);
    double error_rad = 0;
    for (std::size_t k = 0; k < 4; ++k) error_rad += by_boundaries[k] * (is[k] - believed[k]);
    sum += error_rad, squares += error_rad * error_rad;
    variance += std::pow(predicted_print_error_rad(rig, tau_rad, measured.tolerance_m), 2);
  }
  const double mean = sum / steps;
  return {std::sqrt(std::max(0.0, squares / steps - mean * mean)), std::sqrt(variance / steps)};
}

// Medians of the frames that show the marker.
void add_light(const std::vector<FrameEvidence>& frames, const Marker& marker, RigFindings& findings) {
  std::vector<FrameEvidence> lit;
  std::ranges::copy_if(frames, std::back_inserter(lit), [](const FrameEvidence& f) { return f.light.has_value(); });
  if (lit.empty()) return;
  const auto typical = [&](auto value) {
    return median(values_of(lit, [=](const FrameEvidence& f) { return std::invoke(value, *f.light); }));
  };
  MarkerLight& light = findings.light.emplace();
  light.clipped = typical(&MarkerLight::clipped), light.value = typical(&MarkerLight::value);
  light.chroma = typical(&MarkerLight::chroma);
  for (std::size_t band = 0; band < 3; ++band) {
    light.hues_deg[band] = typical([=](const MarkerLight& of) { return of.hues_deg[band]; });
    findings.hue_error_deg = std::max(findings.hue_error_deg, hue_gap_deg(light.hues_deg[band], marker.hues_deg[band]));
  }
  findings.hue_faults =
      recorded_hues(values_of(lit, [&](const FrameEvidence& f) { return frame_hues(*f.light, marker); })).faults;
  findings.width_px = median(values_of(lit, &FrameEvidence::width_px));
}

class Advisor {
 public:
  explicit Advisor(const RigFindings& findings) : f_(findings) {}

  std::vector<Advice> all() {
    light(), colours(), compression(), response(), camera(), print(), movement(), joints(), delay(), registration();
    missed_rcm(), view(), found();
    std::ranges::stable_sort(advice_, std::greater{}, &Advice::needed);
    return std::move(advice_);
  }

 private:
  static constexpr auto calibrate_registration = "lapservo calibrate registration",
                        mount_anew = "mount the marker anew";

  void add(bool needed, std::string what, std::string command, std::string gain) {
    advice_.push_back({needed, std::move(what), std::move(command), std::move(gain)});
  }

  bool dark() const {
    return f_.light ? f_.light->value < rig_limits.dark_value || f_.light->chroma < rig_limits.dark_chroma
                    : f_.picture.dark();
  }
  bool clipped() const { return f_.light ? f_.light->clipped > rig_limits.clipped : f_.picture.overexposed(); }
  bool seldom_found() const { return f_.found < rig_limits.found * static_cast<double>(f_.frames); }
  std::string found_text() const {
    const std::string found = fmt::format("the marker is found in {} of {} frames", f_.found, f_.frames);
    if (f_.failure == Status::ok) return found;
    return fmt::format("{}, else mostly {}{}", found, to_string(f_.failure),
                       f_.cause.empty() ? fmt::format(": {}", usual_cause(f_.failure)) : "");
  }

  void light() {
    const std::string where = f_.light ? "the marker" : "the image";
    if (clipped())
      add(true,
          fmt::format("{} is overexposed: {:.0f} % of its pixels are saturated", where,
                      100 * (f_.light ? f_.light->clipped : f_.picture.clipped)),
          "lower the exposure, the gain or the light, and record again",
          "boundaries where light is lost now; all other numbers here count only then");
    else if (dark())
      add(true,
          fmt::format("{} is dark: its values reach {:.0f} of 255", where,
                      f_.light ? f_.light->value : f_.picture.value),
          "take the cap off the lens, raise the light or the exposure, come nearer, and record again",
          "sigma falls as the light rises; all other numbers here count only then");
  }

  void colours() {
    if (f_.light && f_.hue_error_deg > rig_limits.hue_deg)
      add(true, fmt::format("the bands' hues are {:.0f} degrees from the rig's", f_.hue_error_deg),
          "lapservo calibrate colour", "the marker is found where its colours are near the limit now");
    for (const HueFault& fault : f_.hue_faults)
      add(fault.size_deg > rig_limits.hue_deg, fault.what, fault.remedy + ", and record again",
          "hues that stay the rig's: where they leave them the marker is not found");
    if ((f_.light && f_.cause.empty()) || clipped() || dark()) return;
    add(true, found_text() + f_.cause, "mend that, and record again where it was the recording", "finding it at all");
  }

  void compression() {
    if (f_.lossy && seldom_found() && comes_by_compression(f_.failure))
      add(true,
          fmt::format("the recording is compressed, and the marker is found in {} of {} frames, else mostly {}",
                      f_.found, f_.frames, to_string(f_.failure)),
          "record without losses or at a higher bit rate", "the frames that are refused now");
  }

  void response() {
    if (!f_.response || !f_.response->better || f_.response->before_px < rig_limits.response_px) return;
    if (f_.lossy) {
      add(false,
          fmt::format(
              "the recording is compressed: edges of channels that rise and fall at one place lie {:.2f} px apart",
              f_.response->before_px),
          "record without losses or at a higher bit rate",
          "sigma of psi, and whether the rig's response is the camera's");
      return;
    }
    add(true,
        fmt::format("the camera encodes light otherwise than the rig says{}, rather as {}: edges of channels that rise "
                    "and fall at one place lie {:.2f} px apart",
                    f_.response_measured ? " and a board did" : "", f_.response->name, f_.response->before_px),
        f_.response_measured ? "switch off the camera's sharpening and record again; where that changes nothing, "
                               "lapservo calibrate colour --replace-response"
                             : "lapservo calibrate colour",
        fmt::format("edges {:.2f} px nearer to each other, and psi with them",
                    f_.response->before_px - f_.response->after_px));
  }

  void camera() {
    if (!f_.arm || !f_.arm->refusal.empty() || !f_.arm->focal.exceeds(rig_limits.focal)) return;
    add(true,
        fmt::format("the focal length is {:.1f} % off (sigma {:.2f} %)", 100 * f_.arm->focal.value,
                    100 * f_.arm->focal.sigma),
        "lapservo calibrate camera", "depth is as far off as the focal length; then calibrate registration");
  }

  void print() {
    const PrintCheck print = f_.print.value_or(PrintCheck{});
    if (!print.contradiction.empty())
      add(true, "the frames do not show one print: " + print.contradiction, "mend that, and record again",
          "a print 0.1 mm off costs tens of mrad of psi");
    else if (f_.print && print.refusal.empty() && print.psi_rad.exceeds(rig_limits.print_rad))
      add(true,
          fmt::format("the print is not the rig's: its boundaries lie {:.2f} px off, psi is {:.0f} mrad rms off",
                      print.before_px, 1e3 * print.psi_rad.value),
          "lapservo calibrate marker",
          fmt::format("psi: {:.1f} mrad rms less, and no marker_mismatch", 1e3 * print.psi_rad.value));
    else if (f_.cause.empty() && 5 * static_cast<std::size_t>(f_.mismatched) > f_.frames)
      add(true,
          fmt::format("{} of {} frames are marker_mismatch: the print is not the rig's", f_.mismatched, f_.frames),
          "lapservo calibrate marker", "psi, where it is refused now");
    else if (!print.refusal.empty() && f_.light)
      add(false, "whether the print is the rig's is unknown: " + print.refusal,
          "record a full turn, then lapservo check", "a print 0.1 mm off costs tens of mrad of psi");
  }

  void movement() {
    const auto moves = [&](const Told& drift_m, const Told& drift_rad) {
      if (!drift_m.exceeds(rig_limits.drift_m) && !drift_rad.exceeds(rig_limits.drift_rad)) return;
      add(true,
          fmt::format("something moves: the marker drifts by {:.1f} mm and {:.0f} mrad over the recording",
                      1e3 * drift_m.value, 1e3 * drift_rad.value),
          "fasten the endoscope, the arm's base, the trocar and the marker, and record again",
          "no registration holds while it does");
    };
    if (f_.arm && f_.arm->refusal.empty()) moves(f_.arm->drift_m, f_.arm->drift_rad);
    if (f_.rcm && f_.rcm->refusal.empty()) moves(f_.rcm->drift_m, {});
  }

  void joints() {
    if (!f_.arm || !f_.arm->refusal.empty() || !(f_.arm->noise > rig_limits.noise)) return;
    const ArmCheck& arm = *f_.arm;
    const double place_m = rms(arm.at_best, &ArmResidual::position_m),
                 axis_rad = rms(arm.at_best, &ArmResidual::axis_rad),
                 roll_rad = rms(arm.at_best, &ArmResidual::roll_rad);
    add(place_m > rig_limits.place_m || axis_rad > rig_limits.axis_rad || roll_rad > rig_limits.roll_rad,
        fmt::format("joints and images disagree by {:.0f} times the images' noise after any calibration ({:.1f} mm, "
                    "{:.0f} mrad of the axis, {:.0f} mrad about it): {}",
                    arm.noise, 1e3 * place_m, 1e3 * axis_rad, 1e3 * roll_rad,
                    arm.fault.empty() ? "no one fault of the joints' readings explains it" : arm.fault),
        "mend that; where it was the recording, record the marker and the joints again; then lapservo check",
        "the same in each pose that the joints give");
  }

  void delay() {
    if (!f_.arm || !f_.arm->refusal.empty()) return;
    const auto& delay = f_.arm->delay_s;
    if (delay && delay->exceeds(rig_limits.delay_s))
      add(true,
          fmt::format("image_delay_s is {:.0f} ms off: it is {:.3f} s (sigma {:.1f} ms)", 1e3 * delay->value,
                      f_.arm->measured_delay_s, 1e3 * delay->sigma),
          "lapservo calibrate registration --joints",
          fmt::format("at 50 mm/s the marker is {:.1f} mm from where it is expected", 50 * delay->value));
    else if (!delay)
      add(false, fmt::format("the rig has no image_delay_s; here it is {:.3f} s", f_.arm->measured_delay_s),
          "lapservo calibrate registration --joints", "the loop need not learn it");
  }

  void registration() {
    constexpr auto command = calibrate_registration;
    if (f_.arm && !f_.arm->refusal.empty())
      add(true, "joints and images can't be compared: " + f_.arm->refusal,
          "mend that; where it was the recording, record the marker and the joints again; then lapservo check",
          "delay, registration and focal length");
    if (!f_.registered) {
      if (f_.has_joints)
        add(true, "the rig has no camera_from_rcm", command, "theta, phi, rho, psi and r, which are unknown without");
      else
        add(false,
            "delay, focal length and registration are not checked: they need joints, and the rig has no "
            "camera_from_rcm; the marker's pose in the camera frame needs neither",
            std::string("for a robot, ") + command, "theta, phi, rho, psi and r");
      return;
    }
    if (f_.arm) {
      if (!f_.arm->refusal.empty()) return;
      const ArmCheck& arm = *f_.arm;
      const Eigen::Vector3d sigmas(arm.place_m->sigma, arm.axis_rad->sigma, arm.roll_rad->sigma);
      if (sigmas[0] > rig_limits.place_m || sigmas[1] > rig_limits.axis_rad || sigmas[2] > rig_limits.roll_rad)
        add(true,
            fmt::format("this recording does not show whether the registration is right: it places the marker to "
                        "{:.1f} mm, {:.0f} mrad (axis), {:.0f} mrad (about it), one sigma: {}",
                        1e3 * sigmas[0], 1e3 * sigmas[1], 1e3 * sigmas[2], arm.fault.empty() ? swing_more : arm.fault),
            "record the marker and the joints again; then lapservo check", "whether the registration is right");
      const bool placed = !arm.place_m->exceeds(rig_limits.place_m) && !arm.axis_rad->exceeds(rig_limits.axis_rad);
      if (!placed || arm.roll_rad->exceeds(rig_limits.roll_rad))
        add(true,
            fmt::format("the registration puts the marker {:.1f} mm, {:.0f} mrad (axis), {:.0f} mrad (about it) from "
                        "where it is: {}",
                        1e3 * arm.place_m->value, 1e3 * arm.axis_rad->value, 1e3 * arm.roll_rad->value,
                        !arm.other_signs.empty()
                            ? fmt::format("the sign of {} is the other", fmt::join(arm.other_signs, " and "))
                        : placed ? "the marker, or the zero of the roll's joint, was turned about the shaft"
                                 : "the endoscope or the arm's base was moved, or a joint's zero is another"),
            std::string(command) + " --joints", fmt::format("as much: {:.1f} mm", 1e3 * arm.place_m->value));
      return;
    }
    if (!f_.rcm) return;
    if (!f_.rcm->refusal.empty())
      add(f_.rcm->refusal == reversed_marker, "whether the RCM is right is unknown: " + f_.rcm->refusal,
          f_.rcm->refusal == reversed_marker ? mount_anew : "record a swing, then lapservo check",
          "an RCM that is off bends every pose");
    else if (f_.rcm->distance_m.exceeds(2 * rig_limits.place_m))
      add(true,
          fmt::format("the axes meet {:.1f} mm from the rig's RCM (sigma {:.1f} mm)", 1e3 * f_.rcm->distance_m.value,
                      1e3 * f_.rcm->distance_m.sigma),
          std::string(command) + " --joints", "poses that the RCM does not bend");
    else if (f_.rcm->distance_m.sigma > 2 * rig_limits.place_m)
      add(true,
          fmt::format("this recording does not show whether the rig's RCM is right: it places the RCM to {:.1f} mm, "
                      "one sigma: {}",
                      1e3 * f_.rcm->distance_m.sigma, swing_more),
          "record a longer swing, or the joints too; then lapservo check", "whether the RCM is right");
    if (!f_.has_joints)
      add(false, "delay, focal length and the joints' offsets are unknown without the joints",
          "lapservo check --joints", "the same page with them");
  }

  // Where nothing above says so.
  void missed_rcm() {
    if (!f_.missed_rcm.is_wrong()) return;
    const std::string command = f_.missed_rcm.is_reversed() ? mount_anew : calibrate_registration;
    if (std::ranges::any_of(advice_, [&](const Advice& a) { return a.needed && a.command.starts_with(command); }))
      return;
    add(true, f_.missed_rcm.text(), command, "theta, phi, rho and psi, which these frames lack");
  }

  // Without any reason above.
  void found() {
    if (seldom_found() && std::ranges::none_of(advice_, &Advice::needed))
      add(true, found_text(), "lapservo track --overlay, to see what hides it", "a loop that does not hold");
  }

  void view() {
    if (f_.light && f_.width_px < rig_limits.width_px)
      add(true, fmt::format("the shaft is {:.0f} px wide in the image", f_.width_px),
          "come nearer, or use more of the camera's resolution", "sigma falls with the square of the size");
    if (f_.work_space && f_.work_space->good < rig_limits.work_space)
      add(true,
          fmt::format("psi's sigma stays below {:.0f} mrad in {:.0f} % of the work space; up to {:.0f} mrad",
                      1e3 * rig_limits.sigma_rad, 100 * f_.work_space->good, 1e3 * f_.work_space->worst_rad) +
              (f_.work_space->lost ? fmt::format(", and in {} of {} places the marker is not found",
                                                 f_.work_space->lost, f_.work_space->places)
                                   : ""),
          std::string(f_.lossy ? "record without losses or at a higher bit rate; where that changes nothing, " : "") +
              "come nearer, more light, a longer marker (lapservo marker design)",
          "psi where it is weakest");
  }

  const RigFindings& f_;
  std::vector<Advice> advice_;
};

}  // namespace

PrintCheck check_print(const Rig& rig, std::size_t instrument, std::vector<KeyFrame> frames) {
  PrintCheck check;
  MarkerCalibration calibration = calibrate_marker(rig, instrument, std::move(frames));
  check.refusal = calibration.refusal;
  if (calibration.contradicts) check.contradiction = calibration.refusal;
  if (!check.refusal.empty()) return check;
  check.before_px = calibration.before_px, check.after_px = calibration.after_px;
  check.psi_rad = psi_by_print(rig.instruments[instrument].marker, calibration.marker);
  if (!calibration.faults.empty() && check.psi_rad.sigma > rig_limits.print_rad)
    check.contradiction = calibration.faults.front();
  check.residuals = std::move(calibration.before);
  return check;
}

RcmCheck check_rcm(const Instrument& instrument, const std::vector<TimedPose>& poses) {
  RcmCheck check;
  const Registration registration = register_rcm(instrument, poses);
  if (!registration.refusal.empty()) return check.refusal = registration.refusal, check;
  for (const RegistrationResidual& r : registration.residuals) check.misses_m.emplace_back(r.time_s, r.position_m);
  check.distance_m = {(instrument.camera_from_rcm->translation - registration.camera_from_rcm.translation).norm(),
                      registration.sigma_translation_m.norm()};
  const auto middle = poses.begin() + static_cast<std::ptrdiff_t>(poses.size() / 2);
  const auto first = axes_meeting_point({poses.begin(), middle}), second = axes_meeting_point({middle, poses.end()});
  if (first && second)
    check.drift_m = {2 * (first->point_m - second->point_m).norm(),
                     4 * std::sqrt((first->covariance + second->covariance).trace())};
  return check;
}

RigFindings findings_of(const Rig& rig, std::size_t instrument, const RigEvidence& evidence) {
  RigFindings findings;
  const auto& frames = evidence.frames();
  findings.frames = frames.size();
  findings.found = evidence.count(Status::ok), findings.mismatched = evidence.count(Status::marker_mismatch);
  std::map<Status, int> failures;
  for (const FrameEvidence& frame : frames)
    if (frame.status != Status::ok) ++failures[frame.status];
  if (!failures.empty())
    findings.failure = std::ranges::max_element(failures, {}, [](const auto& one) { return one.second; })->first;
  findings.picture = evidence.picture();
  const Instrument& of = rig.instruments[instrument];
  add_light(frames, of.marker, findings);
  findings.response = evidence.response();
  findings.response_measured = rig.camera.response.sigma.has_value();
  findings.registered = of.camera_from_rcm.has_value();
  for (const FrameEvidence& frame : frames) {
    if (!findings.registered || frame.status != Status::ok) continue;
    ++findings.missed_rcm.shown;
    if (!frame.psi_rad && frame.marker) findings.missed_rcm.add_missed(*frame.marker, of.camera_from_rcm->translation);
  }
  return findings;
}

std::vector<Advice> advice_on(const RigFindings& findings) {
  return Advisor(findings).all();
}

}  // namespace lapservo::internal
