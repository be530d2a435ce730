// An aixACCT hysteresis table holds up to three loops: P1 with V+, P2 with V+, P3 with V-.
#pragma once

#include "recordings/exchange/conversion/measured.h"
#include "recordings/exchange/testers/tester_table.h"

namespace ferrobench::recordings {

// Takes time, voltage, current, polarization and displacement of the best one: measured at all; run in one
// go, not put together from halves of others; its polarization closest to the integral of its current; the
// first of those. The rest stays in the table. What was taken and why goes into m.findings.
void take_tester_loop(TesterTable& table, Measured& m);

}  // namespace ferrobench::recordings
