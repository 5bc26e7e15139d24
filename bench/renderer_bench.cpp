#include <benchmark/benchmark.h>

#include "bench/frames.h"

namespace lapservo::bench {

void render(benchmark::State& state) {
  const Rig rig = scaled_rig(size_argument(state), static_cast<int>(state.range(2)));
  Renderer renderer = make_renderer(rig);
  int index = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(renderer.render(placements(rig, index), static_cast<std::uint64_t>(index)));
    ++index;
  }
}
BENCHMARK(render)->Apply(every_size_and_number);

}  // namespace lapservo::bench
