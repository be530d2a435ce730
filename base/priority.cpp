#include "base/priority.h"

#include <sys/resource.h>
#include <unistd.h>

namespace ferrobench {

void give_way() {
  // A third of what the bench gets where both want the processor, and not so little that a busy machine draws
  // no report any more. On Linux it is a thread's own.
  constexpr int nice = 5;
  thread_local const int done = setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), nice);
  static_cast<void>(done);
}

}  // namespace ferrobench
