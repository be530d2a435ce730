#include "unit/input_scan.h"

#include <algorithm>
#include <utility>

#include "unit/bytes.h"

namespace ferrobench::emulator {

namespace {

constexpr std::byte last_element{0x80};

// A fault whose moment has come happens once.
bool strikes(std::optional<std::uint64_t>& moment, std::uint64_t scans) {
  if (!moment || scans < *moment) return false;
  moment.reset();
  return true;
}

}  // namespace

InputScan::InputScan(const UnitSetup& setup, Board& board, Faults& faults)
    : setup_(setup),
      board_(board),
      faults_(faults),
      // 250 kS/s without the X in the name, 500 kS/s with it (protocol note 1).
      fastest_(ticks_per_second / (setup.product == 0x0110 || setup.product == 0x0134 ? 250'000 : 500'000)) {
  power_up();
}

void InputScan::power_up() {
  queue_.fill(std::byte{0});
  queue_[0] = last_element;
  source_ = 0;
  stop();
  clear();
  halted_ = false;
}

bool InputScan::set_queue(std::span<const std::byte> elements) {
  if (pacer_.on() || elements.size() != queue_.size()) return false;
  std::copy(elements.begin(), elements.end(), queue_.begin());
  return true;
}

bool InputScan::set_source(unsigned code) {
  if (code >= setup_.internal_sources.size()) return false;
  source_ = code;
  return true;
}

InputScan::Element InputScan::element(std::byte code) {
  const auto bits = std::to_integer<unsigned>(code);
  const unsigned mode = bits >> 5 & 3U;
  return {.input = {.channel = (bits & 7U) + (mode == 2 ? 8U : 0U), .differential = mode == 0},
          .internal = mode == 3,
          .range = bits >> 3 & 3U};
}

bool InputScan::start(std::span<const std::byte> data, Ticks now) {
  if (pacer_.on() || (data.size() != 14 && data.size() != 15)) return false;
  elements_.clear();
  for (const std::byte code : queue_) {
    elements_.push_back(element(code));
    if ((code & last_element) != std::byte{0}) break;
  }
  const auto options = std::to_integer<std::uint8_t>(data[13]);
  const bool retrigger = (options & input_option::retrigger) != 0;
  const ScanOrder order{.scans = get32(data),
                        .per_trigger = get32(data.subspan(4)),
                        .period = get32(data.subspan(8)),
                        .triggered = retrigger || (options & input_option::trigger) != 0,
                        .retriggered = retrigger};
  packet_ = std::to_integer<std::size_t>(data[12]) + 1;
  burst_ = (options & input_option::burst) != 0;
  done_ = overrun_ = zero_length_ = false;
  at_ = 0;
  stored_ = 0;
  skip_ = 0;
  if (order.scans == 0 && faults_.rotated) {
    skip_ = 1;
    faults_.rotated = false;
  }
  free_ = 0;
  pacer_.start(order, faults_.rate_error, now);
  spacing_ = burst_ || pacer_.external() ? fastest_ : std::max(fastest_, pacer_.period() / elements_.size());
  return true;
}

void InputScan::stop() {
  pacer_.stop();
  conversion_ = never;
  hung_ = false;
}

void InputScan::clear() {
  fifo_.clear();
  done_ = overrun_ = zero_length_ = false;
}

std::uint16_t InputScan::convert(const Element& e, Ticks now) {
  const bool garbage = std::exchange(unsettled_, false);
  const double volts = e.internal ? setup_.internal_sources.at(source_) : board_.input(now, e.input);
  if (garbage) return 0;
  return input_code(setup_.calibration.input[e.range], input_full_scale[e.range], volts);
}

bool InputScan::convert_once(unsigned channel, Ticks now, std::uint16_t& code) {
  if (pacer_.on()) return false;
  for (const std::byte bits : queue_) {
    const Element e = element(bits);
    if (e.input.channel == channel) {
      code = convert(e, now);
      return true;
    }
    if ((bits & last_element) != std::byte{0}) break;
  }
  return false;
}

bool InputScan::run(Ticks now) {
  bool edge = false;
  if (conversion_ == now) convert_next(now);
  if (pacer_.next() == now) {
    pacer_.ticked();
    edge = begin_scan(now);
    if (conversion_ == now) convert_next(now);
  }
  return edge;
}

bool InputScan::clock_edge(Ticks now) {
  if (!pacer_.running() || !pacer_.external()) return false;
  if (burst_) {
    const bool edge = begin_scan(now);
    if (conversion_ == now) convert_next(now);
    return edge;
  }
  if (at_ == 0 && !begin_scan(now)) return false;
  convert_next(now);
  return true;
}

bool InputScan::begin_scan(Ticks now) {
  // The converter is still busy with the scan before.
  if (conversion_ != never || now < free_) overrun();
  if (strikes(faults_.overrun, pacer_.scans())) overrun();
  if (!pacer_.running()) return false;
  if (faults_.hang && pacer_.scans() >= *faults_.hang) hung_ = true;
  if (strikes(faults_.input_halt, pacer_.scans())) halted_ = true;
  if (strikes(faults_.lost_sample, pacer_.scans())) ++skip_;
  at_ = 0;
  conversion_ = now;
  return true;
}

void InputScan::convert_next(Ticks now) {
  const std::uint16_t code = convert(elements_[at_], now);
  free_ = now + fastest_;
  if (skip_ > 0)
    --skip_;
  else
    store(code);
  if (at_ == 0 && strikes(faults_.doubled_sample, pacer_.scans())) store(code);
  if (overrun_) return;
  ++at_;
  const bool single = pacer_.external() && !burst_;
  conversion_ = single ? never : now + spacing_;
  if (at_ < elements_.size()) return;
  at_ = 0;
  conversion_ = never;
  if (pacer_.scan_taken()) {
    done_ = true;
    zero_length_ = 2 * stored_ % setup_.max_packet() == 0;
  }
}

void InputScan::store(std::uint16_t code) {
  if (fifo_.room() == 0) {
    overrun();
    return;
  }
  fifo_.push(code);
  ++stored_;
}

void InputScan::overrun() {
  overrun_ = true;
  pacer_.stop();
  conversion_ = never;
}

Handshake InputScan::take_packet(std::vector<std::byte>& packet) {
  packet.clear();
  if (halted_) return Handshake::stall;
  if (hung_) return Handshake::nak;
  std::size_t samples = packet_;
  if (fifo_.size() < packet_) {
    if (!done_) return Handshake::nak;
    if (fifo_.size() == 0) {
      if (!zero_length_) return Handshake::nak;
      zero_length_ = false;
      return Handshake::ack;
    }
    samples = fifo_.size();
  }
  if (samples > 1 && strikes(faults_.short_packet, pacer_.scans())) samples /= 2;
  packet.resize(2 * samples);
  for (std::size_t i = 0; i < samples; ++i) put16(std::span(packet).subspan(2 * i), fifo_.pop());
  return Handshake::ack;
}

std::uint16_t InputScan::status() const {
  std::uint16_t bits = 0;
  if (pacer_.on()) bits |= status_bit::input_running;
  if (overrun_) bits |= status_bit::overrun;
  if (done_) bits |= status_bit::input_done;
  return bits;
}

}  // namespace ferrobench::emulator
