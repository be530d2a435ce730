// ferrobench_run_states [STEPS [SEED [CLIENTS [deaths]]]]: the figures, and exit code 1 if anything was not
// as the model has it.
#include <cstdlib>
#include <iostream>

#include "tests/server/run_states.h"

int main(int argc, char** argv) {
  using namespace ferrobench::server::states;
  const auto steps = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 100'000;
  const auto seed = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1;
  const int clients = argc > 3 ? std::atoi(argv[3]) : 4;
  const bool deaths = argc > 4 && std::string_view(argv[4]) == "deaths";
  const auto figures = play(steps, clients, seed, deaths);
  std::cout << figures;
  return figures.failures.empty() ? EXIT_SUCCESS : EXIT_FAILURE;
}
