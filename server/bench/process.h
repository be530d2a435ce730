// The bench as a process of its own: this program once more, which does nothing else.
#pragma once

#include <sys/types.h>

#include "recordings/disk/durable_file.h"

namespace ferrobench::bench {

struct Process {
  pid_t number = 0;
  recordings::Descriptor socket;  // to its Host
};
// It lives on when this process ends (host.h). Throws Error(device_unavailable) if none can be started.
Process start_process();

}  // namespace ferrobench::bench
