// Google Benchmark: the pieces that a change to the model is likely to move.
#include <benchmark/benchmark.h>

#include "tests/bench/exp_limit.h"
#include "tests/bench/kernel_bench.h"
#include "tests/bench/ours.h"

namespace ferrobench::bench {
namespace {

const model::LoadPath path{{0, -8e6}, {-2e4, -8.1e6}, {}};

void exponentials(benchmark::State& state) {
  std::vector<double> in(1024, -3.0), out(1024);
  for (auto _ : state) vector_exp(in.data(), out.data(), in.size());
  state.SetItemsProcessed(state.iterations() * 1024);
}
BENCHMARK(exponentials);

void kernel_moving_loads(benchmark::State& state) {
  const auto creep = make_creep(0);
  KernelBench kernel(creep.domains, model::kinetic_constants(creep.model.material));
  kernel.start(path.from);
  for (auto _ : state) benchmark::DoNotOptimize(kernel.step(0.02, path));
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(kernel.size()));
}
BENCHMARK(kernel_moving_loads);

void kernel_held(benchmark::State& state) {
  const auto creep = make_creep(0);
  KernelBench kernel(creep.domains, model::kinetic_constants(creep.model.material));
  kernel.start(path.from);
  for (auto _ : state) benchmark::DoNotOptimize(kernel.hold(0.02));
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(kernel.size()));
}
BENCHMARK(kernel_held);

void nodes(benchmark::State& state) {
  const auto m = model::library_model("soft-pzt");
  for (auto _ : state)
    benchmark::DoNotOptimize(
        model::make_domains(m.material, m.polycrystal, static_cast<int>(state.range(0)), 0));
}
BENCHMARK(nodes)->Arg(256)->Arg(1024);

// Arguments: spring in N/mm, tolerance in 1e-5.
void creep_protocol(benchmark::State& state) {
  const auto creep = make_creep(1e3 * static_cast<double>(state.range(0)));
  const model::SimulationOptions options{
      .tolerance = 1e-5 * static_cast<double>(state.range(1)), .domains = 1024, .shift = 0};
  OurRun run;
  for (auto _ : state) run = run_ours(creep, options);
  state.counters["domain_steps"] = static_cast<double>(run.statistics.domain_steps);
  state.counters["steps"] = static_cast<double>(run.statistics.steps);
}
BENCHMARK(creep_protocol)
    ->ArgsProduct({{0, 2700}, {100, 10}})
    ->ArgNames({"spring_N_per_mm", "tolerance_1e-5"})
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace ferrobench::bench
