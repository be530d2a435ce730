// ASCII exports of aixACCT TF Analyzers: Piezo, DynamicHysteresis, PulseResult, Leakage, Fatigue.
//
//     PiezoResult                      the first line; a Fatigue file begins with the second part
//     Table 1                          a summary, a row for each table
//     Piezo                            the second part
//     Program: ...                     header of the file
//     Table 1 | Data Table [1,2]       and for each table
//     Area [mm2]: 60                   its header,
//     Time [s] <tab> V+ [V] ...        its columns,
//     0.000000e+000 <tab> ...          and rows to a blank line
//
// The pulses of a PulseResult stand side by side, each with its time; here they follow each other.
#pragma once

#include "recordings/exchange/testers/tester_table.h"

namespace ferrobench::recordings {

bool looks_like_aixacct(std::string_view text);
// Error(bad_recording) with the line that does not fit.
std::vector<TesterTable> read_aixacct(std::string_view text, const Progress& progress);

}  // namespace ferrobench::recordings
