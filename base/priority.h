// Who gives way where the processor is short.
#pragma once

namespace ferrobench {

// This thread, and those that it starts from now on, let the bench go first: the threads that feed the
// device, write its samples and answer stops.
void give_way();
// This thread goes before ordinary ones: it is one of those on the way of a stop. Does nothing where that is
// not allowed (LimitNICE=-10 of systemd allows it).
void take_precedence();

}  // namespace ferrobench
