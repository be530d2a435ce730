// The analog input: queue, scan, FIFO and bulk endpoint (protocol note 3 and 4).
//
// A tick of the pacer is one scan. With burst the channels are converted back to back, otherwise spread
// evenly over the period. On an external clock an edge is a scan with burst and a single conversion without.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "unit/board.h"
#include "unit/faults.h"
#include "unit/handshake.h"
#include "unit/pacer.h"
#include "unit/requests.h"
#include "unit/sample_fifo.h"
#include "unit/unit_setup.h"

namespace ferrobench::emulator {

class InputScan {
 public:
  InputScan(const UnitSetup& setup, Board& board, Faults& faults);

  void power_up();
  // The FPGA has just been loaded: the first conversion after that is garbage, whoever asks for it.
  void unsettle() { unsettled_ = true; }
  const std::array<std::byte, 16>& queue() const { return queue_; }
  bool set_queue(std::span<const std::byte> elements);     // 16 bytes, while no scan runs
  bool start(std::span<const std::byte> data, Ticks now);  // 14 or 15 bytes
  void stop();
  void clear();
  bool set_source(unsigned code);  // internal voltage, 0..10
  // One conversion on demand; the queue's first element with this channel says range and mode.
  bool convert_once(unsigned channel, Ticks now, std::uint16_t& code);

  void trigger(Ticks now) { pacer_.trigger(now); }
  bool armed() const { return pacer_.armed(); }
  bool on() const { return pacer_.on(); }
  bool hung() const { return hung_; }
  // Whether the FIFO overruns within `time` if nothing is read.
  bool overruns_within(Ticks time) const {
    const Ticks scan = std::max(pacer_.external() ? 0 : pacer_.period(), fastest_ * elements_.size());
    return pacer_.running() && fifo_.room() < (time / std::max<Ticks>(scan, 1) + 1) * elements_.size();
  }
  std::uint64_t scans() const { return pacer_.scans(); }
  Ticks next() const { return std::min(pacer_.next(), conversion_); }
  // Does what is due at `now`. True: a scan began, the clock output has an edge.
  bool run(Ticks now);
  bool clock_edge(Ticks now);  // at the external clock input

  Handshake take_packet(std::vector<std::byte>& packet);  // empty: a zero-length packet
  void clear_halt() { halted_ = false; }
  std::uint16_t status() const;

 private:
  struct Element {
    AnalogInput input;
    bool internal = false;
    unsigned range = 0;
  };
  static Element element(std::byte code);
  std::uint16_t convert(const Element& element, Ticks now);
  bool begin_scan(Ticks now);
  void convert_next(Ticks now);
  void store(std::uint16_t code);
  void overrun();

  const UnitSetup& setup_;
  Board& board_;
  Faults& faults_;
  std::array<std::byte, 16> queue_{};
  std::vector<Element> elements_;  // of the scan
  Pacer pacer_;
  SampleFifo<input_fifo_samples> fifo_;
  unsigned source_ = 0;
  Ticks fastest_;  // ticks of a conversion
  Ticks conversion_ = never, spacing_ = 0;
  Ticks free_ = 0;            // the converter, from then on
  std::size_t at_ = 0;        // element that is converted next
  std::size_t packet_ = 256;  // samples
  std::size_t skip_ = 0;      // conversions that get lost
  std::uint64_t stored_ = 0;  // samples since START
  bool burst_ = false;
  bool unsettled_ = false;
  bool done_ = false, overrun_ = false, zero_length_ = false, halted_ = false, hung_ = false;
};

}  // namespace ferrobench::emulator
