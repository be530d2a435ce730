// Runs with a fault in them, one after the other on the same device, each followed by a sound one.
//
// What every run must keep, whatever happens: each row that is handed on is the right one (its place in the
// pattern, its field), a run that says that it is complete has all rows, the output is at zero afterwards or
// the outcome says that it may not be, and what went wrong is said.
#pragma once

#include <string>

#include "rig.h"

namespace ferrobench::emulator {

// Those after which a run cannot be complete. The others may pass unnoticed as long as no row is wrong: a
// request is repeated, a cut packet is put together again, a rate is off by less than a clock can tell.
bool must_be_noticed(FaultKind kind);

class FaultBench {
 public:
  explicit FaultBench(daq::usb::StartMode start);

  struct Result {
    bool whole = false;      // complete, every row there
    bool at_zero = false;    // the outcome says so, and so it is
    std::uint64_t rows = 0;  // handed on and checked
    std::string said;        // why it was not complete
    std::string crime;       // a promise that was broken, or empty
  };
  // The fault strikes somewhere in the run. What the seed draws is the same every time.
  Result faulty(FaultKind kind, std::uint64_t seed);
  // Afterwards, with the unit plugged in again if it has been pulled.
  Result sound(std::uint64_t seed);

 private:
  Result play(std::uint64_t seed, double field_tolerance);
  void check_rows(const daq::SampleBlock& block, std::uint64_t oversampling, double field_tolerance,
                  Result& result) const;
  std::string check_times(std::uint64_t ticks, double tick_rate, double allowed) const;

  ProofBoard board_;
  Rig<ProofBoard> rig_;
};

}  // namespace ferrobench::emulator
