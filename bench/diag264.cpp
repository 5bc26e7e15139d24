// Scratch. diag264 lines NAME... | diag264 fit NAME...
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include "bench/diag264.h"
#include "lapservo/calibration/print_adjustment.h"
using namespace lapservo; using namespace lapservo::acceptance; using namespace lapservo::internal;
static double l_sign(double x) { return x > 0 ? 1 : x < 0 ? -1 : 0; }
static Sighting at_truth(const Loaded& l) { Sighting s = l.key.sighting; s.unknowns = PoseUnknowns::free(get(l.s.truth)); s.film_m = film_mean_m; return s; }
static void lines(const Rig& rig, const std::string& name, const Marker& print, bool) {
  Rig exact = rig; exact.instruments[0].marker = print;
  ViewMeasurer m(exact, 0);
  int nth = 0;
  for (const Loaded& l : load264(exact, "/tmp/p264/" + name + ".bin")) {
    if (nth++ % 2 != 0) continue;
    Sighting s = at_truth(l);
    MarkerView plain = l.key.view; plain.bgr = l.plain;
    const auto reach = ViewMeasurer::Reach{2, 0.4e-3, true, true};
    ViewMeasurements a, b;
    Sighting sp = s;
    for (int i = 0; i < 3; ++i) { a = m.measure(l.key.view, print, s, reach); s.blur = a.edges.improved(s.blur); b = m.measure(plain, print, sp, reach); sp.blur = b.edges.improved(sp.blur); }
    std::map<std::pair<std::size_t, long>, const Measurement*> of;
    for (const Measurement& x : b.edges.all) of[{x.group, std::lround(1e4 * (x.group < 4 ? x.turn_fraction : double(x.expected_px.x() + x.expected_px.y())))}] = &x;
    if (a.processing.edges) { const auto& p = a.processing.edges->processing; std::printf("P %s %d %c %g %g %g %g %g %g %g %g %g\n", name.c_str(), l.s.k, l.s.type, s.blur.boundaries_px, p.blur_px, p.log_mosaic, p.chroma_variance_px2, p.saturation, p.sharpening, p.sharpening_px, a.processing.edges->misfit, sp.blur.boundaries_px); }
    else std::printf("Q %s %d %c %g %d\n", name.c_str(), l.s.k, l.s.type, s.blur.boundaries_px, int(a.processing.processing));
    for (std::size_t i = 0; i < a.edges.all.size(); ++i) { const Measurement& x = a.edges.all[i];
      const auto f = of.find({x.group, std::lround(1e4 * (x.group < 4 ? x.turn_fraction : double(x.expected_px.x() + x.expected_px.y())))});
      if (f == of.end()) continue;
      double bias = 0, own = 0;
      if (a.processing.edges && x.group < 4) bias = a.processing.edges->bias_px[x.group].value_or(0), own = double(a.processing.edges->measurement_bias_px[i]);
      if (x.group >= 4) own = bias = a.side_biases_px[x.group - 4].value_or(0);
      std::printf("L %s %d %c %g %zu %g %g %g %g %g %g %g %g\n", name.c_str(), l.s.k, l.s.type, l.s.turned, x.group, x.across, x.turn_fraction, x.residual_px, f->second->residual_px, bias, own, x.sigma_px, x.along_px_per_m);
    }
    const auto seam = [&](const char* which, const std::optional<SeamEdge>& p, const std::optional<SeamEdge>& q) { if (p && q) std::printf("S %s %d %c %g %s %g %g %g\n", name.c_str(), l.s.k, l.s.type, l.s.turned, which, p->residual_px, q->residual_px, p->sigma_px); };
    if (a.seam && b.seam) seam("upper", a.seam->upper, b.seam->upper), seam("lower", a.seam->lower, b.seam->lower);
  }
}
// psi by a print less that by the true one, in plain pictures of the turn, mean over frames.
double psi_by(const Rig& rig, const std::vector<Loaded>& all, const Marker& marker) {
  ViewMeasurer m(rig, 0); std::vector<ViewMeasurements> v; std::vector<Sighting> s; std::vector<const Loaded*> of;
  for (std::size_t i = 0; i < all.size(); i += 4) s.push_back(at_truth(all[i])), of.push_back(&all[i]);
  double sum = 0;
  for (int round = 0; round < 3; ++round) {
    v.clear(); sum = 0;
    for (std::size_t i = 0; i < s.size(); ++i) { MarkerView plain = of[i]->key.view; plain.bgr = of[i]->plain; v.push_back(m.measure(plain, marker, s[i], {3, 0.4e-3, true, false})); v.back().seam.reset(); s[i].blur = v.back().edges.improved(s[i].blur); }
    const auto a = adjust(v, marker, {2.5, false, false, false});
    for (std::size_t i = 0; i < s.size(); ++i) { s[i].unknowns = s[i].unknowns.changed_by(a->steps[i].head(6)); s[i].film_m = std::clamp(s[i].film_m + film_sigma_m * a->steps[i][6], 0.0, film_mean_m + 4 * film_sigma_m); sum += wrap_pi(s[i].unknowns.pose().psi_rad - get(of[i]->s.truth).psi_rad); }
  }
  return sum / double(s.size());
}
static void fit(const Rig& rig, const std::string& name, const Marker& print, bool from_truth) {
  Rig start = rig; if (from_truth) start.instruments[0].marker = print;
  auto all = load264(rig, "/tmp/p264/" + name + ".bin");
  std::vector<KeyFrame> frames; for (const Loaded& l : all) { KeyFrame f = l.key; f.view.bgr = f.view.bgr.clone(); if (from_truth) f.sighting = at_truth(l); frames.push_back(std::move(f)); }
  const auto c = calibrate_marker(start, 0, std::move(frames));
  if (!c.refusal.empty()) { std::printf("%s: %s\n", name.c_str(), c.refusal.c_str()); return; }
  const double t = psi_by(rig, all, print), p = psi_by(rig, all, c.marker);
  const PrintShape a = PrintShape::of(c.marker), b = PrintShape::of(print);
  std::printf("%-12s psi %+5.2f (true %+.2f) mrad tol %3.0f um; um upper", name.c_str(), 1e3 * (p - t), 1e3 * t, 1e6 * c.marker.tolerance_m);
  for (int k = 1; k < 4; ++k) std::printf(" %+4.0f", 1e6 * (a.upper_m[k] - b.upper_m[k])); std::printf(" lower");
  for (int k = 0; k < 4; ++k) std::printf(" %+4.0f", 1e6 * (a.lower_m[k] - b.lower_m[k]));
  std::printf(" gap %+4.0f; len %zu\n", 1e6 * (a.gap_rad - b.gap_rad) * print.radius_m(), c.frames);
  std::fflush(stdout);
}
static void sens(const Rig& rig, const std::string& name, const Marker& print) {
  auto all = load264(rig, "/tmp/p264/" + name + ".bin");
  const double t = psi_by(rig, all, print);
  for (int i = 0; i < 8; ++i) { PrintNumbers c = PrintNumbers::Zero(); c[i] = i < 7 ? 20e-6 : 20e-6 / print.radius_m();
    std::printf("%s number %d: %+.3f mrad per 10 um\n", name.c_str(), i, 5e2 * (psi_by(rig, all, changed_by(PrintShape::of(print), c).on(print)) - t)); }
  PrintShape sh = PrintShape::of(print); for (int k = 0; k < 4; ++k) sh.upper_m[k] *= 0.998, sh.lower_m[k] *= 0.998;
  std::printf("%s scale -0.2 %%: %+.3f mrad\n", name.c_str(), 1e3 * (psi_by(rig, all, sh.on(print)) - t));
}

#include <opencv2/imgproc.hpp>
#include "lapservo/vision/edge_lines.h"
// Relocates boundaries in a grey picture along their normals.
static std::size_t relocate(const Rig& rig, const cv::Mat& bgr, ViewMeasurements& v, double blur) {
  cv::Mat luma, grey; cv::cvtColor(bgr, luma, cv::COLOR_BGR2GRAY); cv::cvtColor(luma, grey, cv::COLOR_GRAY2BGR);
  const ImageView image(grey); const auto table = rig.camera.response.table(); const LightImage light(image, table);
  decltype(v.edges.all) out; std::size_t lost = 0;
  for (Measurement m : v.edges.all) {
    if (m.group < 4 && m.group != 1) {
      const int reach = int(std::min<double>(m.clear_px, 5)); 
      EdgeLine line; line.u_px = m.expected_px.x(), line.v_px = m.expected_px.y(), line.du = m.normal.x(), line.dv = m.normal.y(); line.before = line.after = reach; line.blur_px = float(blur);
      bool in = reach >= 3;
      for (int t : {-reach, reach}) in = in && light.contains((m.expected_px + float(t) * m.normal).cast<double>());
      if (!in) { ++lost; continue; }
      const EdgeFit f = fit_step(sample_profile(light, line), float(blur), 6);
      if (!f.converged || std::abs(double(f.offset_px) - m.residual_px) > 1.5) { ++lost; continue; }
      m.residual_px = double(f.offset_px);
    }
    out.push_back(m);
  }
  v.edges.all = out; return lost;
}
// What of the measurements at the true poses makes psi's error: a group of the video's residuals by the plain ones.
static std::vector<double> sens_of(const Rig& rig, const std::vector<Loaded>& all, const Marker& print) {
  const double t = psi_by(rig, all, print); std::vector<double> out;
  for (int i = 0; i < 8; ++i) { PrintNumbers c = PrintNumbers::Zero(); c[i] = i < 7 ? 20e-6 : 20e-6 / print.radius_m();
    out.push_back((psi_by(rig, all, changed_by(PrintShape::of(print), c).on(print)) - t) / c[i]); }
  return out;
}
static long key_of(const Measurement& x) { return std::lround(1e4 * (x.group < 4 ? x.turn_fraction : double(x.expected_px.x() + x.expected_px.y()))); }
static void attr(const Rig& rig, const std::string& name, const Marker& print) {
  Rig exact = rig; exact.instruments[0].marker = print;
  ViewMeasurer m(exact, 0);
  auto all = load264(exact, "/tmp/p264/" + name + ".bin");
  const auto sens = sens_of(rig, all, print);
  std::vector<ViewMeasurements> video, plain;
  const bool only = std::getenv("ANY") == nullptr;
  for (const Loaded& l : all) {
    Sighting s = at_truth(l), sp = s; MarkerView pl = l.key.view; pl.bgr = l.plain;
    ViewMeasurements a, b;
    for (int i = 0; i < 3; ++i) { a = m.measure(l.key.view, print, s, {2, 0.4e-3, true, true, only}); s.blur = a.edges.improved(s.blur); b = m.measure(pl, print, sp, {2, 0.4e-3, true, false}); sp.blur = b.edges.improved(sp.blur); }
    if (std::getenv("LUMA")) { static std::size_t n = 0; const auto k = relocate(exact, l.key.view.bgr, a, 0.94) + relocate(exact, pl.bgr, b, 0.94); if (k > 100 && n++ < 3) std::printf("lost %zu\n", k); }
    a.turned_rad = b.turned_rad = l.s.turned;
    video.push_back(a), plain.push_back(b);
  }
  if (std::getenv("LUMA")) for (auto& v : video) if (v.processing.edges) for (int g : {0, 2, 3}) v.processing.edges->bias_px[std::size_t(g)] = 0;
  if (std::getenv("SHAPE")) {
    std::array<std::array<double, 6>, 4> cs{}, cn{}, gs{}, gn{};
    for (std::size_t f = 0; f < plain.size(); ++f) {
      auto col = plain[f]; ViewMeasurements gr = col; relocate(exact, all[f].plain, gr, 0.94);
      const auto add = [](const ViewMeasurements& v, auto& s, auto& n) { for (const auto& x : v.edges.all) if (x.group < 4) { const auto k = std::min<std::size_t>(5, std::size_t((x.across + 1) * 3)); if (std::abs(x.residual_px) < 1) s[x.group][k] += x.residual_px, n[x.group][k] += 1; } };
      add(col, cs, cn), add(gr, gs, gn);
    }
    for (std::size_t g = 0; g < 4; ++g) { double a = 0, b = 0, c = 0, d = 0; for (std::size_t k = 0; k < 6; ++k) a += cs[g][k], b += cn[g][k], c += gs[g][k], d += gn[g][k]; std::printf("G e%zu plain color %+.3f grey - color %+.3f;", g, a / b, c / d - a / b); for (std::size_t k = 0; k < 6; ++k) std::printf(" %+.3f", gs[g][k] / gn[g][k] - cs[g][k] / cn[g][k]); std::printf("; color"); for (std::size_t k = 0; k < 6; ++k) std::printf(" %+.3f", cs[g][k] / cn[g][k]); std::printf("\n"); }
  }
  take_processing_off(video);
  // match
  for (std::size_t f = 0; f < video.size(); ++f) {
    std::map<std::pair<std::size_t, long>, const Measurement*> of;
    for (const Measurement& x : plain[f].edges.all) of[{x.group, key_of(x)}] = &x;
    decltype(video[f].edges.all) av, ap;
    for (const Measurement& x : video[f].edges.all) { auto it = of.find({x.group, key_of(x)}); if (it == of.end()) continue; Measurement y = x; y.residual_px = it->second->residual_px; av.push_back(x), ap.push_back(y); }
    video[f].edges.all = av; plain[f].edges.all = ap;
    const auto both = [](std::optional<SeamEdge>& a, std::optional<SeamEdge>& b) { if (!a || !b) a.reset(), b.reset(); else { auto c = *a; c.residual_px = b->residual_px; b = c; } };
    if (video[f].seam && plain[f].seam) both(video[f].seam->upper, plain[f].seam->upper), both(video[f].seam->lower, plain[f].seam->lower);
    else video[f].seam.reset(), plain[f].seam.reset();
    plain[f].bias_px = video[f].bias_px, plain[f].blur_px = video[f].blur_px;
  }
  Eigen::Matrix<double, 8, 1> solution;
  const auto psi = [&](const std::vector<ViewMeasurements>& v) {
    const auto a = adjust(v, print, {2.5, true, true, false}); double sum = 0;
    for (int i = 0; i < 8; ++i) sum += sens[std::size_t(i)] * a->print[i], solution[i] = 1e6 * a->print[i] * (i == 7 ? print.radius_m() : 1);
    return 1e3 * sum;
  };
  const auto show = [&](const char* what, const std::vector<ViewMeasurements>& v, double from) { const double p = psi(v); std::printf("%-12s %-22s psi %+6.2f (%+6.2f) ", name.c_str(), what, p, p - from); for (int i = 0; i < 8; ++i) std::printf(" %+4.0f", solution[i]); std::printf("\n"); return p; };
  const double base = show("plain", plain, 0);
  show("video", video, base);
  const auto with = [&](const char* what, auto&& change) { auto v = plain; for (std::size_t f = 0; f < v.size(); ++f) change(f, v[f]); show(what, v, base); };
  if (std::getenv("QUICK")) { std::array<double, 4> s{}, n{}; for (std::size_t f = 0; f < plain.size(); ++f) for (std::size_t i = 0; i < plain[f].edges.all.size(); ++i) { const auto& x = plain[f].edges.all[i]; const double d = video[f].edges.all[i].residual_px - x.residual_px; if (x.group < 4 && std::abs(d) < 0.5) s[x.group] += d, n[x.group] += 1; } std::printf("   means"); for (std::size_t g = 0; g < 4; ++g) std::printf(" %+.3f", s[g] / n[g]); std::printf("\n"); return; }
  const auto diff = [&](std::size_t f, std::size_t i) { return video[f].edges.all[i].residual_px - plain[f].edges.all[i].residual_px; };
  for (std::size_t g = 0; g < 6; ++g) {
    char t[60]; std::snprintf(t, 60, g < 4 ? "e%zu all" : "side%zu", g < 4 ? g : g - 4);
    with(t, [&](std::size_t f, ViewMeasurements& v) { for (std::size_t i = 0; i < v.edges.all.size(); ++i) if (v.edges.all[i].group == g) v.edges.all[i].residual_px += diff(f, i); });
    if (g >= 4) continue;
    double sum = 0, n = 0; std::array<double, 6> bs{}, bn{}; std::array<double, 12> ts{}, tn{};
    const auto bin = [](const Measurement& x) { return std::min<std::size_t>(5, std::size_t((x.across + 1) * 3)); };
    const auto tb = [](const Measurement& x) { return std::min<std::size_t>(11, std::size_t(x.turn_fraction * 12)); };
    for (std::size_t f = 0; f < plain.size(); ++f) for (std::size_t i = 0; i < plain[f].edges.all.size(); ++i) { const auto& x = plain[f].edges.all[i]; if (x.group == g && std::abs(diff(f, i)) < 0.5) sum += diff(f, i), n += 1, bs[bin(x)] += diff(f, i), bn[bin(x)] += 1, ts[tb(x)] += diff(f, i), tn[tb(x)] += 1; }
    const double mean = sum / n;
    std::printf("   e%zu mean %+.3f px; by across", g, mean); for (std::size_t k = 0; k < 6; ++k) std::printf(" %+.3f", bs[k] / std::max(1.0, bn[k])); std::printf("; by tau"); for (std::size_t k = 0; k < 12; ++k) std::printf(" %+.3f", ts[k] / std::max(1.0, tn[k])); std::printf("\n");
    with("   its mean", [&](std::size_t, ViewMeasurements& v) { for (auto& x : v.edges.all) if (x.group == g) x.residual_px += mean; });
    with("   by across - mean", [&](std::size_t, ViewMeasurements& v) { for (auto& x : v.edges.all) if (x.group == g) x.residual_px += bs[bin(x)] / std::max(1.0, bn[bin(x)]) - mean; });
    with("   by tau - mean", [&](std::size_t, ViewMeasurements& v) { for (auto& x : v.edges.all) if (x.group == g) x.residual_px += ts[tb(x)] / std::max(1.0, tn[tb(x)]) - mean; });
    with("   frame mean - mean", [&](std::size_t f, ViewMeasurements& v) { double a = 0, c = 0; for (std::size_t i = 0; i < v.edges.all.size(); ++i) if (v.edges.all[i].group == g && std::abs(diff(f, i)) < 0.5) a += diff(f, i), c += 1; for (auto& x : v.edges.all) if (x.group == g && c > 0) x.residual_px += a / c - mean; });
  }
  for (int lower = 0; lower < 2; ++lower) {
    double sum = 0, n = 0, w = 0, ws = 0;
    for (std::size_t f = 0; f < plain.size(); ++f) if (plain[f].seam) { auto& a = lower ? plain[f].seam->lower : plain[f].seam->upper; auto& b = lower ? video[f].seam->lower : video[f].seam->upper; if (a) { const double way = l_sign(video[f].turned_rad); const double d = b->residual_px - a->residual_px; sum += d, n += 1; w += way * d; ws += 1 / (b->sigma_px * b->sigma_px); } }
    std::printf("   seam %s mean %+.3f px by way %+.3f n %g rms sigma %.3f\n", lower ? "lower" : "upper", sum / n, w / n, n, 1 / std::sqrt(ws / n));
    with(lower ? "seam lower" : "seam upper", [&](std::size_t f, ViewMeasurements& v) { if (v.seam) { auto& e = lower ? v.seam->lower : v.seam->upper; if (e) e = lower ? video[f].seam->lower : video[f].seam->upper; } });
  }
}
static void profiles(const Rig& rig, const std::string& name, const Marker& print) {
  Rig exact = rig; exact.instruments[0].marker = print; ViewMeasurer m(exact, 0);
  double sum[2][4][13][3] = {}, n[4] = {}, clip[2][4][13] = {};
  for (const Loaded& l : load264(exact, "/tmp/p264/" + name + ".bin")) {
    Sighting s = at_truth(l); MarkerView pl = l.key.view; pl.bgr = l.plain;
    const auto b = m.measure(pl, print, s, {2, 0.4e-3, true, false});
    for (const auto& x : b.edges.all) { if (x.group >= 4 || std::abs(x.across) > 0.5 || x.clear_px < 6) continue;
      n[x.group] += 1;
      for (int t = -6; t <= 6; ++t) for (int w = 0; w < 2; ++w) { const cv::Mat& im = w ? l.key.view.bgr : pl.bgr; const Eigen::Vector2f at = x.expected_px + float(t) * x.normal; const int u = int(at.x()), v = int(at.y()); const float fu = at.x() - float(u), fv = at.y() - float(v);
        for (int c = 0; c < 3; ++c) { const auto px = [&](int y, int z) { return float(im.at<cv::Vec3b>(v + y, u + z)[c]); }; sum[w][x.group][t + 6][c] += double((1 - fv) * ((1 - fu) * px(0, 0) + fu * px(0, 1)) + fv * ((1 - fu) * px(1, 0) + fu * px(1, 1))); }
        if (im.at<cv::Vec3b>(v, u)[0] == 0 || im.at<cv::Vec3b>(v, u)[1] == 0 || im.at<cv::Vec3b>(v, u)[2] == 0) clip[w][x.group][t + 6] += 1; } }
  }
  for (int g = 0; g < 4; ++g) for (int w = 0; w < 2; ++w) { std::printf("e%d %s\n", g, w ? "video" : "plain"); for (int c = 0; c < 5; ++c) { for (int t = 0; t < 13; ++t) { const auto& v = sum[w][g][t]; std::printf(" %6.2f", c < 3 ? v[c] / n[g] : c == 3 ? (.114 * v[0] + .587 * v[1] + .299 * v[2]) / n[g] : 100 * clip[w][g][t] / n[g]); } std::printf("  %s\n", c == 0 ? "b" : c == 1 ? "g" : c == 2 ? "r" : c == 3 ? "Y" : "% clipped"); } }
}
int main(int argc, char** argv) {
  const Rig rig = example_rig();
  for (int i = 2; i < argc; ++i) {
    const std::string name = argv[i]; int seed = 0, print = 0; std::sscanf(argv[i], "%d_%d", &seed, &print);
    const Marker truth = true_print(rig, seed, print);
    if (!std::strcmp(argv[1], "lines")) lines(rig, name, truth, true);
    if (!std::strcmp(argv[1], "fit")) fit(rig, name, truth, false);
    if (!std::strcmp(argv[1], "sens")) sens(rig, name, truth);
    if (!std::strcmp(argv[1], "profiles")) profiles(rig, name, truth);
    if (!std::strcmp(argv[1], "attr")) attr(rig, name, truth);
    if (!std::strcmp(argv[1], "fittrue")) fit(rig, name, truth, true);
  }
}
