#include <benchmark/benchmark.h>

#include "bench/frames.h"

namespace lapservo::bench {

// Argument: image width.
void render(benchmark::State& state) {
  const Rig rig = scaled_rig(static_cast<int>(state.range(0)), 1);
  Renderer renderer = make_renderer(rig);
  int index = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(renderer.render(placements(rig, index), static_cast<std::uint64_t>(index)));
    ++index;
  }
}
BENCHMARK(render)->Arg(640)->Arg(1280)->Arg(1920)->Unit(benchmark::kMillisecond);

}  // namespace lapservo::bench
