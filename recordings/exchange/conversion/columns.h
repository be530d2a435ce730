// A tester's table as what it measured: which column is what, in SI units.
#pragma once

#include "recordings/exchange/conversion/measured.h"
#include "recordings/exchange/testers/tester_table.h"

namespace ferrobench::recordings {

// Takes the columns out of the table. `area` is the one by which the tester divided. A unit that is not
// understood, a column that is missing, a time that does not rise: Error(bad_recording) with the line.
Measured measured_of(TesterTable& table, const Specimen& specimen, double area);

}  // namespace ferrobench::recordings
