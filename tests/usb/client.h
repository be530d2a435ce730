// A plain host of the emulated unit, for the tests: requests by number, scans as the protocol note orders
// them.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "boards/loopback.h"
#include "boards/pattern.h"
#include "host/port.h"
#include "unit/bytes.h"
#include "unit/requests.h"

namespace ferrobench::emulator {

using Bytes = std::vector<std::byte>;

inline Bytes bytes_of(std::initializer_list<unsigned> values) {
  Bytes out;
  for (const unsigned v : values) out.push_back(static_cast<std::byte>(v));
  return out;
}

inline Bytes samples_of(std::span<const std::uint16_t> samples) {
  Bytes out;
  for (const std::uint16_t s : samples) append16(out, s);
  return out;
}

struct InputOrder {
  std::uint32_t scans = 0, per_trigger = 0, period = 0;
  unsigned packet_size = 255, options = 0;
  std::size_t length = 14;  // or 15
};

inline Bytes input_order(const InputOrder& order) {
  Bytes out;
  append32(out, order.scans);
  append32(out, order.per_trigger);
  append32(out, order.period);
  out.push_back(static_cast<std::byte>(order.packet_size));
  out.push_back(static_cast<std::byte>(order.options));
  out.resize(order.length);
  return out;
}

inline Bytes output_order(std::uint32_t scans, std::uint32_t per_trigger, std::uint32_t period,
                          unsigned options) {
  Bytes out;
  append32(out, scans);
  append32(out, per_trigger);
  append32(out, period);
  out.push_back(static_cast<std::byte>(options));
  return out;
}

// Channels single-ended 0..7 on +-10 V, in this order.
inline Bytes queue_of(std::initializer_list<unsigned> channels) {
  Bytes out(16);
  std::size_t at = 0;
  for (const unsigned c : channels) out[at++] = static_cast<std::byte>(c | 1U << 5);
  out[channels.size() - 1] |= std::byte{0x80};
  return out;
}

inline constexpr std::uint32_t period_of(double rate) {
  return static_cast<std::uint32_t>(static_cast<double>(ticks_per_second) / rate - 1);
}

class Client {
 public:
  explicit Client(const UnitSetup& setup = loaded(), Board* board = nullptr)
      : unit(setup, board != nullptr ? *board : loopback), port(unit) {}

  static UnitSetup loaded() {
    UnitSetup setup;
    setup.fpga_loaded = true;
    return setup;
  }
  static UnitSetup perfect() {
    UnitSetup setup = loaded();
    setup.calibration.input.fill({});
    setup.calibration.output.fill({});
    return setup;
  }

  Outcome write(unsigned number, unsigned value = 0, unsigned index = 0, const Bytes& data = {}) {
    Bytes answer;
    return port.control({.type = vendor_out,
                         .number = static_cast<std::uint8_t>(number),
                         .value = static_cast<std::uint16_t>(value),
                         .index = static_cast<std::uint16_t>(index),
                         .length = static_cast<std::uint16_t>(data.size())},
                        data, answer);
  }
  // Nothing: a stall.
  std::optional<Bytes> read(unsigned number, std::size_t length, unsigned value = 0, unsigned index = 0) {
    Bytes answer;
    const Outcome outcome = port.control({.type = vendor_in,
                                          .number = static_cast<std::uint8_t>(number),
                                          .value = static_cast<std::uint16_t>(value),
                                          .index = static_cast<std::uint16_t>(index),
                                          .length = static_cast<std::uint16_t>(length)},
                                         {}, answer);
    if (outcome != Outcome::ok) return std::nullopt;
    return answer;
  }
  unsigned word(unsigned number, unsigned value = 0) {
    const auto answer = read(number, 2, value);
    return answer && answer->size() == 2 ? get16(*answer) : 0xFFFFFFFF;
  }
  unsigned status() { return word(request::status); }
  void load_fpga(std::size_t image) {
    EXPECT_EQ(write(request::fpga_configure, 0, 0, bytes_of({fpga_key})), Outcome::ok);
    for (std::size_t sent = 0; sent < image; sent += 64)
      EXPECT_EQ(write(request::fpga_data, 0, 0, Bytes(std::min<std::size_t>(64, image - sent))), Outcome::ok);
  }
  bool clear_halt(std::uint8_t endpoint) {
    Bytes answer;
    return port.control({.type = 0x02, .number = 0x01, .value = 0, .index = endpoint, .length = 0}, {},
                        answer) == Outcome::ok;
  }

  void pass(double seconds) {
    port.advance(port.now() +
                 static_cast<Ticks>(std::llround(seconds * static_cast<double>(ticks_per_second))));
  }
  // Keeps `transfers` IN transfers under way for so long and returns the samples that came.
  std::vector<std::uint16_t> collect(double seconds, std::size_t transfers = 8, std::size_t length = 8192) {
    std::vector<std::uint16_t> samples;
    const auto take = [&] {
      for (const auto& f : port.take_finished()) {
        if (f.endpoint != input_endpoint) continue;
        outcomes.push_back(f.outcome);
        lengths.push_back(f.moved);
        for (std::size_t i = 0; i + 1 < f.data.size(); i += 2)
          samples.push_back(get16(std::span(f.data).subspan(i)));
        --under_way_;
      }
    };
    for (double t = 0; t < seconds; t += 1e-3) {
      while (under_way_ < transfers) {
        port.submit_in(next_id++, input_endpoint, length);
        ++under_way_;
      }
      pass(1e-3);
      take();
    }
    return samples;
  }

  LoopbackBoard loopback;
  Unit unit;
  Port port;
  std::vector<Outcome> outcomes;     // of the IN transfers
  std::vector<std::size_t> lengths;  // bytes that each brought
  std::uint64_t next_id = 1;

 private:
  std::size_t under_way_ = 0;
};

}  // namespace ferrobench::emulator
