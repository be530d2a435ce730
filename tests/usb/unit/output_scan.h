// The analog output's scan: FIFO, pacer and bulk endpoint (protocol note 5).
//
// Data may come before START. A scan that has begun with an empty FIFO waits for the first data; one that
// runs dry later sets the underrun bit and ends. Its outputs keep their last values.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "unit/faults.h"
#include "unit/handshake.h"
#include "unit/pacer.h"
#include "unit/requests.h"
#include "unit/sample_fifo.h"
#include "unit/unit_setup.h"

namespace ferrobench::emulator {

// New codes by channel, where there are any.
using OutputUpdate = std::array<std::optional<std::uint16_t>, 2>;

class OutputScan {
 public:
  OutputScan(const UnitSetup& setup, Faults& faults) : setup_(setup), faults_(faults) {}

  void power_up();
  bool start(std::span<const std::byte> data, Ticks now);  // 13 or 16 bytes
  void stop();
  void clear();

  void trigger(Ticks now) { pacer_.trigger(now); }
  // Whether the FIFO runs dry within `time` if nothing is written; on an external clock, by its top rate.
  bool runs_dry_within(Ticks time) const {
    const Ticks update = pacer_.external() ? ticks_per_second / 500'000 : pacer_.period();
    return pacer_.running() &&
           fifo_.size() < (time / update + 1) * static_cast<std::size_t>(std::popcount(mask_));
  }
  bool armed() const { return pacer_.armed(); }
  bool on() const { return pacer_.on(); }
  std::uint64_t scans() const { return pacer_.scans(); }
  Ticks next() const { return pacer_.next(); }
  // What is due at `now`; nothing: no update.
  std::optional<OutputUpdate> run(Ticks now);
  std::optional<OutputUpdate> clock_edge(Ticks now);  // at the external clock input

  Handshake give_packet(std::span<const std::byte> packet, Ticks now);
  void clear_halt() { halted_ = false; }
  std::uint16_t status() const;

 private:
  std::optional<OutputUpdate> update();

  const UnitSetup& setup_;
  Faults& faults_;
  Pacer pacer_;
  SampleFifo<output_fifo_samples> fifo_;
  std::optional<std::byte> half_;  // of a sample that is not complete yet
  unsigned mask_ = 0;
  bool starved_ = false;  // waits for its first data
  bool done_ = false, underrun_ = false, halted_ = false, hung_ = false;
};

}  // namespace ferrobench::emulator
