// ferrobench_damage [FILES [SEED [FOLDER]]]: as many damaged files as asked for, the figures, and exit code 1
// if anything failed.
#include <cstdlib>
#include <iostream>

#include "tests/faults/damage.h"

int main(int argc, char** argv) {
  using namespace ferrobench::faults;
  const int files = argc > 1 ? std::atoi(argv[1]) : 2000;
  const auto seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  const auto figures = damage_files(files, seed, argc > 3 ? argv[3] : "damaged");
  std::cout << figures;
  return figures.failures.empty() ? EXIT_SUCCESS : EXIT_FAILURE;
}
