// accuracy_study STUDY [FRAMES [SEED [ROW...]]]: accuracy and normalised errors of the tracker, a row for each
// condition of the study (camera, samples, blood or motion: accuracy_study.h), all of them without ROW. Tables of
// docs/notes/accuracy.md. The study "edges" is of single boundaries and sides, "hostile" counts false accepts,
// "colours" what pixels show.
#include "bench/accuracy_study.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <map>

namespace lapservo::bench {
namespace {
using namespace acceptance;

void print_row(const std::string& name, const Score& s) {
  const auto mrad = [](double rad) { return 1e3 * rad; };
  std::printf("| %s | %d | %.0f %% | %+.2f | %.2f | %.2f | %.2f | %.2f, %.2f | %.3f | %.3f |", name.c_str(), s.expected,
              100 * s.found_fraction(), mrad(mean(s.psi_rad)), mrad(standard_deviation(s.psi_rad)),
              mrad(rms(s.psi_rad)), mrad(largest(s.psi_rad)), mrad(rms(s.theta_rad)), mrad(rms(s.phi_rad)),
              1e3 * rms(s.rho_m), rms(s.edge_px));
  for (const auto* in_sigmas : {&s.psi_sigmas, &s.theta_sigmas, &s.phi_sigmas, &s.rho_sigmas})
    std::printf(" %.2f, %.1f |", rms(*in_sigmas), largest(*in_sigmas));
  std::printf(" %d |", s.wrong);
  for (const auto& [status, count] : s.refusals) std::printf(" %d %s", count, status.c_str());
  std::printf("\n");
  std::fflush(stdout);
}

int run(const std::vector<Row>& rows, int frames, std::uint64_t seed, const std::vector<std::string>& names) {
  std::puts(
      "| set | instruments | found | psi mean [mrad] | std | rms | largest | theta, phi rms [mrad] | rho rms [mm] | "
      "e0..e3 rms [px] | z, largest | z of theta | z of phi | z of rho | wrong |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
  for (const Row& row : rows)
    if (names.empty() || std::find(names.begin(), names.end(), row.name) != names.end())
      print_row(row.name, row.measure(frames, seed));
  return 0;
}

}  // namespace

void take_print_for(TrueFrame& frame, const Marker& marker) {
  Marker& print = frame.rig.instruments[0].marker;
  frame.truths[0].q.psi_rad += print.seam_rad - marker.seam_rad;
  print = marker;
}

void score_alone(const TrueFrame& frame, Score& score) {
  score.add(frame, Tracker(frame.rig, {.method = Method::surface, .single = true}).track(frame.bgr));
}

}  // namespace lapservo::bench

int main(int argc, char** argv) {
  using namespace lapservo::bench;
  const std::map<std::string, std::vector<Row> (*)()> studies{
      {"camera", camera_rows}, {"samples", samples_rows}, {"blood", blood_rows}, {"motion", motion_rows}};
  const std::string name = argc > 1 ? argv[1] : "";
  const int frames = argc > 2 ? std::atoi(argv[2]) : 40;
  const std::uint64_t seed = argc > 3 ? static_cast<std::uint64_t>(std::atoll(argv[3])) : 1;
  if (name == "edges") return print_edge_errors(frames, seed), 0;
  if (name == "hostile") return print_false_accepts(frames, seed), 0;
  if (name == "colours") return print_colour_frequencies(frames, seed), 0;
  const auto study = studies.find(name);
  if (study == studies.end())
    return std::fputs("accuracy_study camera|samples|blood|motion|edges|hostile|colours [FRAMES [SEED [ROW...]]]\n",
                      stderr),
           2;
  return run(study->second(), frames, seed, {argv + std::min(argc, 4), argv + argc});
}
