// Text exports of Radiant's Vision: Hysteresis, Remanent Hysteresis, Leakage. Code page 1252 or UTF-8.
//
//     >>>> Hysteresis <<<<             titles between rows of angle quotes, the first one names the task
//     Sample Area (cm2):<tab>1.00e-04  header lines
//     Points:<tab>501
//     Point <tab> Time (ms) <tab> Drive Voltage <tab> Measured Polarization
//     1 <tab> 2.0e-02 <tab> ...        rows to a blank line
//     PMax (uC/cm2):<tab>4.63e+01      figures
//
// Vision writes no units for voltage and polarization; they are V and uC/cm2, as the figures behind the rows
// have them.
#pragma once

#include "recordings/exchange/testers/tester_table.h"

namespace ferrobench::recordings {

bool looks_like_radiant(std::string_view text);
std::vector<TesterTable> read_radiant(std::string_view text, const Progress& progress);

}  // namespace ferrobench::recordings
