#include "server/bench/priority.h"

#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <cerrno>
#include <system_error>

namespace ferrobench::bench {

namespace {

constexpr int priority = 10;  // above all ordinary threads, below those of the kernel's drivers

}  // namespace

std::string lock_memory() {
  if (mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0) return "";
  return "its memory is not locked (" + std::generic_category().message(errno) + "; LimitMEMLOCK=infinity)";
}

std::string may_go_first() {
  const sched_param before{}, wanted{.sched_priority = priority};
  if (sched_setscheduler(0, SCHED_RR, &wanted) != 0)
    return "it has no real-time priority (" + std::generic_category().message(errno) +
           "; LimitRTPRIO=" + std::to_string(priority) + ")";
  sched_setscheduler(0, SCHED_OTHER, &before);
  return "";
}

void go_first() {
  const sched_param wanted{.sched_priority = priority};
  sched_setscheduler(0, SCHED_RR, &wanted);
}

}  // namespace ferrobench::bench
