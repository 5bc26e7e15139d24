// Scratch. diag264 lines NAME... | diag264 fit NAME...
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include "bench/diag264.h"
#include "lapservo/calibration/print_adjustment.h"
using namespace lapservo; using namespace lapservo::acceptance; using namespace lapservo::internal;
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
int main(int argc, char** argv) {
  const Rig rig = example_rig();
  for (int i = 2; i < argc; ++i) {
    const std::string name = argv[i]; int seed = 0, print = 0; std::sscanf(argv[i], "%d_%d", &seed, &print);
    const Marker truth = true_print(rig, seed, print);
    if (!std::strcmp(argv[1], "lines")) lines(rig, name, truth, true);
    if (!std::strcmp(argv[1], "fit")) fit(rig, name, truth, false);
    if (!std::strcmp(argv[1], "sens")) sens(rig, name, truth);
    if (!std::strcmp(argv[1], "fittrue")) fit(rig, name, truth, true);
  }
}
