// Columns and figures of Radiant Vision.
#pragma once

#include "recordings/exchange/conversion/measured.h"
#include "recordings/exchange/testers/tester_table.h"

namespace ferrobench::recordings {

// Voltage and polarization in the units that Vision writes behind the rows only: V and uC/cm2. Of a remanent
// hysteresis the switching run, Logic 1; the other one and their difference go along.
void take_radiant_loop(TesterTable& table, Measured& m);
void take_radiant_leakage(TesterTable& table, Measured& m);

// Vision's own figures and its header against the rows and the specimen.
void check_radiant(const TesterTable& table, Measured& m, const Specimen& specimen);

}  // namespace ferrobench::recordings
