#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>

#include "recordings/file/writer.h"
#include "tests/bench/compare.h"
#include "tests/bench/cpu_time.h"
#include "tests/bench/exp_limit.h"
#include "tests/bench/kernel_bench.h"
#include "tests/bench/ours.h"

namespace ferrobench::bench {

void compare_kernel() {
  std::printf("\n## Kernel, every domain in every step\n\n");
  std::printf(
      "Limit: 6 exponentials a domain-step and nothing else, by the same vector library. Goal: 0.4.\n\n");
  std::printf(
      "| instruction set | exp, 1e6/s | moving loads, 1e6 domain-steps/s | of the limit | held, 1e6 "
      "domain-steps/s |\n");
  std::printf("|---|---|---|---|---|\n");
  const auto creep = make_creep(0);
  constexpr std::size_t exps = 1024;
  constexpr int repeats = 300;
  std::vector<double> in(exps), out(exps);
  for (std::size_t i = 0; i < exps; ++i) in[i] = -20.0 * static_cast<double>(i) / exps;
  const model::LoadPath path{{0, -8e6}, {-2e4, -8.1e6}, {}};
  for (const auto& target : model::kernel_targets()) {
    model::force_kernel_target(target);
    KernelBench kernel(creep.domains, model::kinetic_constants(creep.model.material));
    kernel.start(path.from);
    double sum = 0;
    const auto rate = [&](std::size_t items, auto&& run) {
      return static_cast<double>(items * repeats) / 1e6 /
             least_time(
                 [&] {
                   for (int i = 0; i < repeats; ++i) run();
                 },
                 7, 0.1);
    };
    const double exp = rate(exps, [&] { vector_exp(in.data(), out.data(), exps); });
    const double step = rate(kernel.size(), [&] { sum += kernel.step(0.02, path).plus; });
    const double hold = rate(kernel.size(), [&] { sum += kernel.hold(0.02).plus; });
    if (!std::isfinite(sum)) throw std::runtime_error("the kernel gave no number");
    std::printf("| %s | %.0f | %.1f | %.2f | %.1f |\n", target.c_str(), exp, step, 6 * step / exp, hold);
    model::force_kernel_target("");
  }
}

void compare_quadrature() {
  for (const double spring : {0.0, 2.7e6}) {
    const auto creep = make_creep(spring);
    const auto run = [&](double tolerance, int nodes, std::uint64_t shift) {
      return run_ours(creep, {.tolerance = tolerance, .domains = nodes, .shift = shift});
    };
    constexpr double exact = 1e-5;
    const auto limit = run(exact, 60000, 0);
    std::printf("\n## Quadrature against 60,000 nodes, %s\n\n",
                spring == 0 ? "constant stress" : "spring of 2.7e6 N/m");
    std::printf(
        "Errors of two shifts of the lattice, rms over the range; the estimate is their difference over "
        "sqrt(2).\n\n");
    std::printf(
        "| nodes | P | P, estimate | displacement | displacement, estimate |\n|---|---|---|---|---|\n");
    for (const int nodes : {128, 256, 512, 1024, 2048, 4096}) {
      const auto a = run(exact, nodes, 0), b = run(exact, nodes, 1);
      const auto error = [](const std::vector<double>& x, const std::vector<double>& y,
                            const std::vector<double>& to) {
        return std::hypot(rms_over_range(x, to), rms_over_range(y, to)) / std::sqrt(2.0);
      };
      std::printf("| %d | %.1e | %.1e | %.1e | %.1e |\n", nodes,
                  error(a.outputs.polarization, b.outputs.polarization, limit.outputs.polarization),
                  rms_over_range(a.outputs.polarization, b.outputs.polarization) / std::sqrt(2.0),
                  error(a.displacement, b.displacement, limit.displacement),
                  rms_over_range(a.displacement, b.displacement) / std::sqrt(2.0));
      static_cast<void>(std::fflush(stdout));
    }
    std::printf("\nNodes and time together. Nodes 0: as many as the simulator takes for its tolerance.\n\n");
    std::printf("| tolerance | nodes | error in displacement | CPU ms |\n|---|---|---|---|\n");
    for (const double tolerance : {1e-2, 3e-3, 1e-3, 3e-4})
      for (const int nodes : {0, 128, 256, 512}) {
        OurRun result;
        const double time = least_time([&] { result = run(tolerance, nodes, 0); }, 5, 0.1);
        std::printf("| %.0e | %d | %.1e | %.2f |\n", tolerance, nodes,
                    rms_over_range(result.displacement, limit.displacement), 1e3 * time);
      }
  }
}

void compare_recording() {
  constexpr std::size_t rows = 1 << 20, block = 4096;
  std::vector<double> values(block);
  for (std::size_t i = 0; i < block; ++i) values[i] = std::sin(1e-3 * static_cast<double>(i));
  const auto folder = std::filesystem::temp_directory_path() / "ferrobench_compare";
  std::filesystem::create_directories(folder);
  const auto raw = (folder / "raw").string(), recording = (folder / "rows.h5").string();
  const double plain = least_time(
      [&] {
        const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(raw.c_str(), "wb"),
                                                                   std::fclose);
        if (!file) throw std::runtime_error("cannot write " + raw);
        for (std::size_t done = 0; done < rows; done += block)
          for (int column = 0; column < 6; ++column)
            if (std::fwrite(values.data(), sizeof(double), block, file.get()) != block)
              throw std::runtime_error("cannot write " + raw);
      },
      5);
  double append = std::numeric_limits<double>::infinity(), finish = append;
  for (int i = 0; i < 5; ++i) {
    std::filesystem::remove(recording);
    recordings::Header header;
    header.start_time = "2026-01-01T12:00:00Z";
    header.specimen = {
        .name = "benchmark", .length = 0.01, .area = 2.5e-5, .layer_thickness = 1e-4, .layer_count = 100};
    recordings::Writer writer(recording, header, recordings::all_channels);
    recordings::Rows part{.time = values, .channels = {}, .counts = {}};
    for (auto& channel : part.channels) channel = values;
    append = std::min(append, least_time(
                                  [&] {
                                    for (std::size_t done = 0; done < rows; done += block)
                                      writer.append(part);
                                  },
                                  1));
    finish = std::min(finish, least_time([&] { writer.finish("complete", "", {}, {}); }, 1));
  }
  std::filesystem::remove_all(folder);
  const auto per_row = [](double time) { return 1e6 * time / rows; };
  std::printf("\n## Recording, time and five channels of 8 bytes\n\n");
  std::printf("| what | CPU us a row | against fwrite |\n|---|---|---|\n");
  std::printf("| fwrite of the same bytes | %.3f | 1 |\n", per_row(plain));
  std::printf("| Writer::append, during the run | %.3f | %.2f |\n", per_row(append), append / plain);
  std::printf("| Writer::finish, compressing afterwards | %.3f | %.2f |\n", per_row(finish), finish / plain);
}

}  // namespace ferrobench::bench
