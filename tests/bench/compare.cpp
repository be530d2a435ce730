#include "tests/bench/compare.h"

#include <cstdio>
#include <exception>

int main() {
  using namespace ferrobench::bench;
  try {
    compare_kernel();
    compare_recording();
    compare_quadrature();
    compare_time_stepping(0);
    compare_time_stepping(2.7e6);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "ferrobench_compare: %s\n", error.what());
    return 1;
  }
  return 0;
}
