// What keeps the bench on time where the machine is busy, as far as the system allows it.
#pragma once

#include <string>

namespace ferrobench::bench {

// Memory that the process has used stays with it. "" or why not.
std::string lock_memory();
// Whether go_first() is allowed: "" or why not.
std::string may_go_first();
// This thread, and those that it starts, run before all that has no real-time priority.
void go_first();

}  // namespace ferrobench::bench
