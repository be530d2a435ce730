#include "unit/output_scan.h"

#include <bit>

#include "unit/bytes.h"

namespace ferrobench::emulator {

void OutputScan::power_up() {
  stop();
  clear();
  halted_ = false;
}

bool OutputScan::start(std::span<const std::byte> data, Ticks now) {
  if (pacer_.on() || (data.size() != 13 && data.size() != 16)) return false;
  const auto options = std::to_integer<std::uint8_t>(data[12]);
  const unsigned mask = options & output_option::channels;
  if (mask == 0) return false;
  const bool retrigger = (options & output_option::retrigger) != 0;
  const ScanOrder order{.scans = get32(data),
                        .per_trigger = get32(data.subspan(4)),
                        .period = get32(data.subspan(8)),
                        .triggered = retrigger || (options & output_option::trigger) != 0,
                        .retriggered = retrigger};
  mask_ = mask;
  done_ = underrun_ = starved_ = false;
  pacer_.start(order, faults_.input_rate_only ? 0 : faults_.rate_error, now);
  return true;
}

void OutputScan::stop() {
  pacer_.stop();
  starved_ = hung_ = false;
}

void OutputScan::clear() {
  fifo_.clear();
  half_.reset();
  done_ = underrun_ = false;
}

std::optional<OutputUpdate> OutputScan::run(Ticks now) {
  if (pacer_.next() != now) return std::nullopt;
  pacer_.ticked();
  return update();
}

std::optional<OutputUpdate> OutputScan::clock_edge(Ticks) {
  if (!pacer_.running() || !pacer_.external()) return std::nullopt;
  return update();
}

std::optional<OutputUpdate> OutputScan::update() {
  if (faults_.hang && pacer_.scans() >= *faults_.hang) hung_ = true;
  if (faults_.output_halt && pacer_.scans() >= *faults_.output_halt) {
    faults_.output_halt.reset();
    halted_ = true;
  }
  const bool forced = faults_.underrun && pacer_.scans() >= *faults_.underrun;
  if (forced) faults_.underrun.reset();
  const auto channels = static_cast<std::size_t>(std::popcount(mask_));
  if (forced || fifo_.size() < channels) {
    if (!forced && pacer_.scans() == 0) {
      starved_ = true;
      pacer_.halt();
    } else {
      underrun_ = true;
      pacer_.stop();
    }
    return std::nullopt;
  }
  OutputUpdate codes;
  for (unsigned channel = 0; channel < codes.size(); ++channel)
    if ((mask_ >> channel & 1U) != 0) codes.at(channel) = fifo_.pop();
  if (pacer_.scan_taken()) done_ = true;
  return codes;
}

Handshake OutputScan::give_packet(std::span<const std::byte> packet, Ticks now) {
  if (halted_) return Handshake::stall;
  const std::size_t bytes = packet.size() + (half_ ? 1 : 0);
  if (hung_ || packet.size() > setup_.max_packet() || bytes / 2 > fifo_.room()) return Handshake::nak;
  for (const std::byte byte : packet) {
    if (!half_) {
      half_ = byte;
      continue;
    }
    fifo_.push(get16(std::array{*half_, byte}));
    half_.reset();
  }
  if (starved_ && pacer_.running() && fifo_.size() >= static_cast<std::size_t>(std::popcount(mask_))) {
    starved_ = false;
    pacer_.restart(now);
  }
  return Handshake::ack;
}

std::uint16_t OutputScan::status() const {
  std::uint16_t bits = 0;
  if (pacer_.on()) bits |= status_bit::output_running;
  if (underrun_) bits |= status_bit::underrun;
  if (done_) bits |= status_bit::output_done;
  return bits;
}

}  // namespace ferrobench::emulator
