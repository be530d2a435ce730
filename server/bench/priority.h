// What keeps the bench on time where the machine is busy, as far as the system allows it.
#pragma once

#include <string>

namespace ferrobench::bench {

// Memory that the process has used stays with it. "" or why not.
std::string lock_memory();
// Of SCHED_RR: above all ordinary threads, below those of the kernel's drivers.
inline constexpr int first_priority = 10;
// This thread runs before all that has no real-time priority; those that it starts are ordinary ones. "" or
// why that is not allowed.
std::string go_first_alone();
// This thread, and those that it starts.
void go_first();

}  // namespace ferrobench::bench
