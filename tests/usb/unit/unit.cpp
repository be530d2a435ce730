#include "unit/unit.h"

#include <algorithm>
#include <cassert>
#include <stdexcept>

#include "unit/requests.h"

namespace ferrobench::emulator {

namespace {

constexpr std::uint16_t middle_code = 0x8000;

}  // namespace

Unit::Unit(const UnitSetup& setup, Board& board)
    : setup_(setup),
      board_(board),
      eeprom_(setup.calibration),
      fpga_(setup.product, setup.fpga_loaded),
      input_(setup_, board, faults_),
      output_(setup_, faults_) {
  if (setup.serial.size() != 8) throw std::invalid_argument("a serial number has 8 characters");
  counters_ = setup.counters;
  reset();
}

void Unit::reset() {
  input_.power_up();
  output_.power_up();
  timer_ = {};
  inputs_ = 0xFF;
  latch_ = 0;
  trigger_mode_ = 0;
  eeprom_.lock();
  eeprom_.set_address(0);
  settling_.clear();
  for (unsigned channel = 0; channel < volts_.size(); ++channel) {
    codes_.at(channel) = middle_code;
    volts_.at(channel) = 0;
    board_.output(now_, channel, 0);
  }
  board_.digital_out(now_, 0, 0);
  trigger_was_ = trigger_level();
}

void Unit::power_up() {
  fpga_.power_up();
  counters_ = setup_.counters;
  powered_ = true;
  reset();
}

void Unit::unplug() {
  lose_bus();
  powered_ = false;
  reset();
}

void Unit::lose_bus() {
  if (on_bus_) ++departures_;
  on_bus_ = false;
}

void Unit::plug() {
  if (!powered_) power_up();
  on_bus_ = true;
}

void Unit::advance(Ticks to) {
  assert(to >= now_);
  while (powered_) {
    const Ticks settled = settling_.empty() ? never : settling_.front().time;
    const Ticks next = std::min({settled, input_.next(), output_.next(), timer_.next()});
    if (next > to) break;
    now_ = next;
    if (settled == next) settle();
    if (timer_.next() == next) {
      const bool before = timer_.level();
      timer_.change();
      timer_changed(before);
    }
    // Inputs first: an output updated at the same tick has not settled for them.
    if (input_.next() == next && input_.run(next)) edge(ClockSource::input_clock_out);
    if (output_.next() == next) put_outputs(output_.run(next));
    check_bus_faults();
  }
  now_ = to;
}

void Unit::check_bus_faults() {
  const bool scanning = input_.on() || output_.on();
  const std::uint64_t scans = input_.on() ? input_.scans() : output_.scans();
  if (scanning && faults_.unplug && scans >= *faults_.unplug) {
    faults_.unplug.reset();
    unplug();
  }
  if (scanning && faults_.bus_loss && scans >= *faults_.bus_loss) {
    faults_.bus_loss.reset();
    lose_bus();
  }
}

void Unit::edge(ClockSource source) {
  for (std::size_t i = 0; i < counters_.size(); ++i)
    if (setup_.wiring.counters.at(i) == source) ++counters_.at(i);
  if (source != ClockSource::input_clock_out && setup_.wiring.input_clock == source &&
      input_.clock_edge(now_))
    edge(ClockSource::input_clock_out);
  if (source != ClockSource::output_clock_out && setup_.wiring.output_clock == source)
    put_outputs(output_.clock_edge(now_));
}

void Unit::put_outputs(const std::optional<OutputUpdate>& update) {
  if (!update) return;
  for (unsigned channel = 0; channel < update->size(); ++channel)
    if (update->at(channel)) set_output(channel, *update->at(channel));
  edge(ClockSource::output_clock_out);
}

void Unit::set_output(unsigned channel, std::uint16_t code) {
  codes_.at(channel) = code;
  settling_.push_back({.time = now_ + setup_.output_settling,
                       .channel = channel,
                       .volts = output_volts(setup_.calibration.output.at(channel), code)});
}

void Unit::settle() {
  while (!settling_.empty() && settling_.front().time == now_) {
    const auto [time, channel, volts] = settling_.front();
    settling_.pop_front();
    volts_.at(channel) = volts;
    board_.output(time, channel, volts);
  }
}

void Unit::timer_changed(bool before) {
  if (timer_.level() == before) return;
  if (timer_.level()) edge(ClockSource::timer);
  watch_trigger();
}

std::uint8_t Unit::pins() {
  const std::uint8_t outside = board_.digital_in(now_);
  return static_cast<std::uint8_t>((latch_ & ~inputs_) | (outside & inputs_));
}

void Unit::digital_changed() {
  const auto driven = static_cast<std::uint8_t>(~inputs_);
  board_.digital_out(now_, static_cast<std::uint8_t>(latch_ & driven), driven);
  watch_trigger();
}

void Unit::set_trigger_pin(bool level) {
  trigger_pin_ = level;
  watch_trigger();
}

bool Unit::trigger_level() {
  switch (setup_.wiring.trigger) {
    case TriggerSource::dio0:
      return (pins() & 1U) != 0;
    case TriggerSource::timer:
      return timer_.level();
    default:
      return trigger_pin_;
  }
}

void Unit::watch_trigger() {
  const bool level = trigger_level();
  const bool changed = level != trigger_was_;
  trigger_was_ = level;
  if (changed && trigger_active()) fire();
}

void Unit::fire_if_level() {
  if ((trigger_mode_ & 1U) == 0 && trigger_active()) fire();
}

void Unit::fire() {
  input_.trigger(now_);
  output_.trigger(now_);
}

std::uint16_t Unit::status() const {
  auto bits = static_cast<std::uint16_t>(input_.status() | output_.status());
  if (fpga_.configured()) bits |= status_bit::fpga_configured;
  if (fpga_.configuring()) bits |= status_bit::fpga_configuring;
  return bits;
}

Handshake Unit::take_packet(std::vector<std::byte>& packet) {
  return input_.take_packet(packet);
}

Handshake Unit::give_packet(std::span<const std::byte> packet) {
  return has_outputs() ? output_.give_packet(packet, now_) : Handshake::stall;
}

}  // namespace ferrobench::emulator
