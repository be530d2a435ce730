// kill_campaign [KILLS [SEED [FOLDER]]]: as many kills as asked for, the figures, and exit code 1 if anything
// failed.
#include <cstdlib>
#include <iostream>

#include "tests/faults/kill.h"

int main(int argc, char** argv) {
  using namespace ferrobench::faults;
  const int kills = argc > 1 ? std::atoi(argv[1]) : 1000;
  const auto seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  const std::filesystem::path folder = argc > 3 ? argv[3] : "kills";
  auto figures = kill_runs(kills, seed, folder);
  const int opened = open_with_h5py(folder, figures.failures);
  std::cout << figures;
  if (opened >= 0) std::cout << "h5py opened " << opened << " files.\n";
  return figures.failures.empty() ? EXIT_SUCCESS : EXIT_FAILURE;
}
