// Who gives way where the processor is short.
#pragma once

namespace ferrobench {

// This thread, and those that it starts from now on, let the bench go first: the threads that feed the
// device, write its samples and answer stops.
void give_way();

}  // namespace ferrobench
