// A USB-1608GX-2AO as its host sees it: control requests, two bulk endpoints, and time, which the owner
// advances.
//
// Transport-free and deterministic: the same calls at the same ticks give the same answers. Written from the
// protocol note; where the note leaves a thing open, the header of the part says what is done here.
//
// One thread at a time.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "unit/board.h"
#include "unit/descriptors.h"
#include "unit/eeprom.h"
#include "unit/faults.h"
#include "unit/fpga.h"
#include "unit/input_scan.h"
#include "unit/output_scan.h"
#include "unit/pulse_timer.h"
#include "unit/unit_setup.h"

namespace ferrobench::emulator {

class Unit {
 public:
  // `board` outlives the unit. serial has 8 characters, or std::invalid_argument.
  Unit(const UnitSetup& setup, Board& board);
  Unit(const Unit&) = delete;
  Unit& operator=(const Unit&) = delete;

  const UnitSetup& setup() const { return setup_; }
  Ticks now() const { return now_; }
  void advance(Ticks to);  // not before now()

  // The answer's data (none for a write), or nothing: a stall. `data` is the data stage of a write.
  std::optional<std::vector<std::byte>> control(const Request& request, std::span<const std::byte> data);
  Handshake take_packet(std::vector<std::byte>& packet);     // endpoint 0x86
  Handshake give_packet(std::span<const std::byte> packet);  // endpoint 0x02

  bool input_on() const { return input_.on() && !input_.armed(); }
  bool output_on() const { return output_.on() && !output_.armed(); }
  // Whether a FIFO overruns or runs dry within `time` if the host does nothing.
  bool input_overruns_within(Ticks time) const { return input_.overruns_within(time); }
  bool output_runs_dry_within(Ticks time) const { return output_.runs_dry_within(time); }
  bool on_bus() const { return on_bus_; }
  unsigned departures() const { return departures_; }  // from the bus, so far
  void unplug();                                       // bus and, as the unit has no other, power
  void lose_bus();  // the bus only, as behind a failing hub: the scans go on
  void plug();      // back on the bus; what lost power starts as new

  void arm(const Faults& faults) { faults_ = faults; }
  const Faults& faults() const { return faults_; }  // those that have not happened yet
  Eeprom& eeprom() { return eeprom_; }

  // The terminals that no request reaches.
  void set_trigger_pin(bool level);
  void count_pulses(unsigned counter, std::uint32_t pulses) { counters_.at(counter) += pulses; }
  double output_voltage(unsigned channel) const { return volts_.at(channel); }  // V, settled
  std::uint8_t output_latch() const { return latch_; }
  unsigned blinks() const { return blinks_; }

 private:
  using Answer = std::optional<std::vector<std::byte>>;
  using Data = std::span<const std::byte>;

  Answer vendor_out(const Request& request, Data data);
  Answer vendor_in(const Request& request);
  Answer standard(const Request& request);
  bool write_digital(const Request& request);
  bool write_input(const Request& request, Data data);
  bool write_output(const Request& request, Data data);
  bool write_timer(const Request& request, Data data);
  bool write_system(const Request& request, Data data);
  bool works_without_fpga(std::uint8_t number) const;
  bool has_outputs() const { return setup_.product == 0x0112 || setup_.product == 0x0136; }
  bool stalls_by_fault(std::uint8_t number);

  void power_up();
  void reset();
  void set_output(unsigned channel, std::uint16_t code);
  void settle();
  void put_outputs(const std::optional<OutputUpdate>& update);
  void edge(ClockSource source);
  void timer_changed(bool before);
  void digital_changed();
  std::uint8_t pins();
  bool trigger_level();
  bool trigger_active() { return trigger_level() == ((trigger_mode_ & 2U) != 0); }
  void watch_trigger();
  void fire_if_level();
  void fire();
  std::uint16_t status() const;
  void check_bus_faults();

  struct Settling {
    Ticks time;
    unsigned channel;
    double volts;
  };

  UnitSetup setup_;
  Board& board_;
  Faults faults_;
  Eeprom eeprom_;
  Fpga fpga_;
  InputScan input_;
  OutputScan output_;
  PulseTimer timer_;
  Ticks now_ = 0;
  bool on_bus_ = true, powered_ = true;
  unsigned departures_ = 0;
  std::uint8_t inputs_ = 0xFF;  // direction mask, 1: input
  std::uint8_t latch_ = 0;
  std::uint8_t trigger_mode_ = 0;
  bool trigger_pin_ = false, trigger_was_ = false;
  std::array<std::uint32_t, 2> counters_{};
  std::array<std::uint16_t, 2> codes_{};  // as last written
  std::array<double, 2> volts_{};
  std::deque<Settling> settling_;
  unsigned blinks_ = 0;
};

}  // namespace ferrobench::emulator
