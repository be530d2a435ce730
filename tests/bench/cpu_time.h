// CPU time of this process and of its children that have ended, so that what else the machine does counts
// little.
#pragma once

#include <sys/resource.h>

#include <algorithm>
#include <ctime>
#include <limits>

namespace ferrobench::bench {

inline double cpu_time() {  // s
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  rusage children{};
  getrusage(RUSAGE_CHILDREN, &children);
  const auto seconds = [](const timeval& v) {
    return static_cast<double>(v.tv_sec) + 1e-6 * static_cast<double>(v.tv_usec);
  };
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec) + seconds(children.ru_utime) +
         seconds(children.ru_stime);
}

// The least CPU time of several runs [s]: at least `runs` of them, more for as long as they last `enough` s.
template <class Run>
double least_time(Run&& run, int runs = 3, double enough = 0) {
  double least = std::numeric_limits<double>::infinity(), total = 0;
  for (int i = 0; i < runs || total < enough; ++i) {
    const double start = cpu_time();
    run();
    const double taken = cpu_time() - start;
    least = std::min(least, taken);
    total += taken;
  }
  return least;
}

}  // namespace ferrobench::bench
