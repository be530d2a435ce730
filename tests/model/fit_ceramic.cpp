// How well, how surely and at what cost a fit from nothing explains a real ceramic: one line for each seed.
//   ferrobench_fit_ceramic [FIRST_SEED [LAST_SEED [STARTS [TABLES]]]]
// TABLES, for example 123456: these tables whole, with pasts that the fit finds; 0 is the tenth.
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
  std::vector<recordings::Recording> tables{ceramic_loop(1), ceramic_loop(2), ceramic_loop(6)};
  if (argc > 4) tables.clear();
  for (const char* table = argc > 4 ? argv[4] : ""; *table != 0; ++table)
    tables.push_back(ceramic_recording(*table == '0' ? 10 : *table - '0'));
  const auto residuals = recording_residuals(std::move(tables));
  fmt::print("rms over range, %: charge/displacement of each table; processor time; simulations\n");
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
    const auto& chosen = result.residuals ? *result.residuals : *residuals;
    for (const auto& [name, rms] : chosen.summary(result.model, {})) fmt::print(" {:5.2f}", rms);
    fmt::print("  {:5.1f} s  {} simulations, cost {:.3f}\n", seconds, result.simulations, result.cost_after);
    if (argc > 4)
      for (const auto& p : result.pasts) fmt::print("   {}: {}\n", p.recording, protocols::in_words(p.past));
    if (std::getenv("SHOW") != nullptr)
      for (const auto& p : result.parameters)
        fmt::print("   {} {:.4g} ({:.4g} .. {:.4g}){}\n", p.free.path, p.to, p.low, p.high,
                   p.determined ? "" : " not determined");
    std::fflush(stdout);
  }
}
