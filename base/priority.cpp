#include "base/priority.h"

#include <sys/resource.h>
#include <unistd.h>

namespace ferrobench {

namespace {

// On Linux it is a thread's own.
void be_nice(int value) {
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), value);
}

}  // namespace

void give_way() {
  // A third of what the bench gets where both want the processor, and not so little that a busy machine draws
  // no report any more.
  thread_local const bool done = (be_nice(5), true);
  static_cast<void>(done);
}

void take_precedence() {
  // Ten times an ordinary thread's share: it is on within a few ms though twenty others want the processor.
  // It is not real-time priority, as what strangers send is handled here and may not keep the processor from
  // all others.
  be_nice(-10);
}

}  // namespace ferrobench
