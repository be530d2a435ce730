#include "server/bench/priority.h"

#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <cerrno>
#include <system_error>

namespace ferrobench::bench {

std::string lock_memory() {
  if (mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0) return "";
  return "its memory is not locked (" + std::generic_category().message(errno) + "; LimitMEMLOCK=infinity)";
}

std::string go_first_alone() {
  const sched_param wanted{.sched_priority = first_priority};
  if (sched_setscheduler(0, SCHED_RR | SCHED_RESET_ON_FORK, &wanted) == 0) return "";
  return "it has no real-time priority (" + std::generic_category().message(errno) +
         "; LimitRTPRIO=" + std::to_string(first_priority) + ")";
}

void go_first() {
  const sched_param wanted{.sched_priority = first_priority};
  sched_setscheduler(0, SCHED_RR, &wanted);
}

}  // namespace ferrobench::bench
