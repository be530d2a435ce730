// How well, how surely and at what cost a fit from nothing explains a real ceramic: one line for each seed.
//   ferrobench_fit_ceramic [FIRST_SEED [LAST_SEED [STARTS]]]
#include <fmt/format.h>

#include <cstdlib>
#include <ctime>

#include "model/inference/study/fit.h"
#include "tests/model/ceramic.h"

int main(int argc, char** argv) {
  using namespace ferrobench;
  using namespace ferrobench::model;
  const int first = argc > 1 ? std::atoi(argv[1]) : 1, last = argc > 2 ? std::atoi(argv[2]) : 10;
  if (!std::filesystem::exists(ceramic_file())) {
    fmt::print("{} is not there\n", ceramic_file().string());
    return 0;
  }
  const auto start = library_model("soft-pzt");
  const auto residuals = recording_residuals({ceramic_loop(1), ceramic_loop(2), ceramic_loop(6)});
  fmt::print("rms over range, %: charge/displacement of 0.1, 0.01 and 1 Hz; processor time; simulations\n");
  for (int seed = first; seed <= last; ++seed) {
    FitOptions options;
    options.free = default_free_parameters(start);
    options.seed = static_cast<std::uint64_t>(seed);
    if (argc > 3) options.starts = std::atoi(argv[3]);
    const auto begin = std::clock();
    std::string stage;
    int count = 0;
    if (std::getenv("STAGES") != nullptr)
      options.progress = [&](const FitProgress& at) {
        ++count;
        if (at.stage != stage)
          fmt::print("   {:6.1f} s, {} : {} cost {:.2f}\n",
                     static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC, count, stage = at.stage,
                     at.cost);
        return true;
      };
    const auto result = fit(start, *residuals, options);
    const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    fmt::print("seed {:2}: ", seed);
    for (const auto& [name, rms] : residuals->summary(result.model, {})) fmt::print(" {:5.2f}", rms);
    fmt::print("  {:5.1f} s  {} simulations, cost {:.3f}\n", seconds, result.simulations, result.cost_after);
    if (std::getenv("SHOW") != nullptr)
      for (const auto& p : result.parameters)
        fmt::print("   {} {:.4g} ({:.4g} .. {:.4g}){}\n", p.free.path, p.to, p.low, p.high,
                   p.determined ? "" : " not determined");
    std::fflush(stdout);
  }
}
