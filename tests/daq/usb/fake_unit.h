// A link with just enough of a unit behind it to drive the driver: it writes down every request, plays what
// it is sent, and can be told to fail. Time is its own and passes while the driver waits.
#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <map>
#include <thread>
#include <vector>

#include "daq/usb/host_clock.h"
#include "daq/usb/little_endian.h"
#include "daq/usb/unit.h"

namespace ferrobench::daq::usb {

class FakeClock final : public HostClock {
 public:
  TimePoint now() const override { return TimePoint(std::chrono::nanoseconds(now_)); }
  void sleep_for(std::chrono::nanoseconds time) override {
    if (real) std::this_thread::sleep_for(time);
    now_ += time.count();
  }
  std::atomic<bool> real = false;  // for a test whose reader must keep up

 private:
  std::atomic<std::int64_t> now_{1'000'000'000};
};

// What the test sees of a unit, whatever link is open to it.
struct FakeState {
  FakeClock clock;
  std::uint16_t product = 0x0112;
  bool fpga = true;
  std::map<std::uint16_t, std::byte> eeprom;
  std::vector<std::byte> fpga_image;
  std::uint8_t latch = 0, inputs_mask = 0xFF;
  std::atomic<std::uint8_t> pins = 0xFF;  // set while a stream runs
  std::uint16_t output = 0x8000;
  std::vector<std::uint16_t> written;  // by single values
  std::vector<std::uint16_t> played;   // by the scan, tick by tick
  std::vector<std::string> requests;   // "40 18 8000 0000 data"
  bool wired = true;                   // trigger or clock
  bool monitor = true;                 // first input follows the output
  std::uint16_t marker = 49152;        // 5 V on the 10 V range
  std::size_t rotation = 0;
  // Faults.
  std::function<LinkStatus(const std::string& request)> refuse;
  std::int64_t overrun_at = -1, rotate_at = -1, unplug_at = -1, stall_at = -1, silent_at = -1;  // ticks
  bool gone = false;
  bool starve_output = false;                     // the unit takes no output
  std::size_t packet = 512, output_packet = 512;  // bytes, of the endpoints
  std::size_t odd_packets = 0;                    // cut packets to this many bytes
};

// What the second input shows at a tick, within the codes that are no clipping.
inline std::uint16_t counter(std::uint64_t tick) {
  return static_cast<std::uint16_t>(1 + tick % 65534);
}

inline std::string hex_of(std::span<const std::byte> bytes) {
  std::string out;
  for (const auto b : bytes) {
    constexpr auto digits = "0123456789abcdef";
    out += digits[static_cast<int>(b) >> 4];
    out += digits[static_cast<int>(b) & 15];
  }
  return out;
}

class FakeUnit final : public Link {
 public:
  explicit FakeUnit(FakeState& state) : s(state) {}

  DeviceId id() const override { return {vendor_id, s.product, 0x0101, "01ABCDEF", "1-1"}; }
  std::size_t packet_bytes(std::uint8_t endpoint) const override {
    return endpoint == 0x86 ? s.packet : s.output_packet;
  }

  LinkStatus control_out(const ControlRequest& r, std::span<const std::byte> data,
                         std::chrono::milliseconds) override {
    if (const auto status = note(r, data); status != LinkStatus::ok) return status;
    switch (r.request) {
      case 0x00:
        s.inputs_mask = static_cast<std::uint8_t>(r.value);
        return LinkStatus::ok;
      case 0x02:
        if ((r.value & 1) != 0 && (s.latch & 1) == 0 && s.wired && input_armed_) begin_scans();
        s.latch = static_cast<std::uint8_t>(r.value);
        return LinkStatus::ok;
      case 0x12:
        input_armed_ = true;
        period_ = std::uint64_t{load_le<std::uint32_t>(data.subspan(8))} + 1;
        packet_bytes_ = 2 * (static_cast<std::size_t>(data[12]) + 1);
        external_clock_ = load_le<std::uint32_t>(data.subspan(8)) == 0;
        return LinkStatus::ok;
      case 0x13:
        input_running_ = input_armed_ = false;
        return LinkStatus::ok;
      case 0x14:
        width_ = 0;
        while ((static_cast<int>(data[width_++]) & 0x80) == 0) {
        }
        return LinkStatus::ok;
      case 0x15:
        overrun_ = false;
        stream_.clear();
        return LinkStatus::ok;
      case 0x18:
        if (output_running_) return LinkStatus::stall;
        s.output = r.value;
        s.written.push_back(r.value);
        return LinkStatus::ok;
      case 0x1A:
        output_running_ = true;
        if (external_clock_) {
          period_ = std::uint64_t{load_le<std::uint32_t>(data.subspan(8))} + 1;
          if (s.wired) begin_scans();
        }
        return LinkStatus::ok;
      case 0x1B:
        output_running_ = false;
        return LinkStatus::ok;
      case 0x1C:
        underrun_ = false;
        fifo_.clear();
        return LinkStatus::ok;
      case 0x31:
        address_ = load_le<std::uint16_t>(data);
        return LinkStatus::ok;
      case 0x50:
        s.fpga_image.clear();
        return LinkStatus::ok;
      case 0x51:
        s.fpga_image.insert(s.fpga_image.end(), data.begin(), data.end());
        return LinkStatus::ok;
      case 0x43:
        return LinkStatus::ok;
      default:
        return LinkStatus::stall;
    }
  }

  LinkStatus control_in(const ControlRequest& r, std::span<std::byte> data, std::size_t& actual,
                        std::chrono::milliseconds) override {
    actual = 0;
    if (const auto status = note(r, {}); status != LinkStatus::ok) return status;
    const auto answer = [&](std::uint16_t value) {
      store_le(value, data.first(2));
      actual = 2;
      return LinkStatus::ok;
    };
    switch (r.request) {
      case 0x01:
        data[0] = static_cast<std::byte>(s.pins.load());
        actual = 1;
        return LinkStatus::ok;
      case 0x10:
        return input_armed_ ? LinkStatus::stall : answer(0x8000);
      case 0x18:
        store_le(s.output, data.first(2));
        store_le(std::uint16_t{0x8000}, data.subspan(2, 2));
        actual = 4;
        return LinkStatus::ok;
      case 0x30:
        for (auto& byte : data) byte = s.eeprom[address_++];
        actual = data.size();
        return LinkStatus::ok;
      case 0x40:
        return answer(static_cast<std::uint16_t>(
            (input_running_ || input_armed_ ? 2 : 0) | (overrun_ ? 4 : 0) | (output_running_ ? 8 : 0) |
            (underrun_ ? 16 : 0) | (s.fpga || !s.fpga_image.empty() ? 256 : 0)));
      default:
        return LinkStatus::stall;
    }
  }

  LinkStatus clear_halt(std::uint8_t) override { return s.gone ? LinkStatus::no_device : LinkStatus::ok; }

  LinkStatus submit_in(std::uint8_t endpoint, std::span<std::byte> buffer, std::uint64_t token) override {
    if (s.gone) return LinkStatus::no_device;
    if (endpoint != 0x86) return LinkStatus::error;
    in_.push_back({buffer, token});
    return LinkStatus::ok;
  }

  LinkStatus submit_out(std::uint8_t endpoint, std::span<const std::byte> buffer,
                        std::uint64_t token) override {
    if (s.gone) return LinkStatus::no_device;
    if (endpoint != 0x02) return LinkStatus::error;
    out_.push_back({buffer, token, 0});
    fill_fifo();
    return LinkStatus::ok;
  }

  void cancel_all() override {
    for (const auto& t : in_)
      done_.push_back({t.token, s.gone ? LinkStatus::no_device : LinkStatus::cancelled, 0});
    for (const auto& t : out_)
      done_.push_back({t.token, s.gone ? LinkStatus::no_device : LinkStatus::cancelled, 0});
    in_.clear();
    out_.clear();
  }

  void wait(std::chrono::milliseconds timeout, std::vector<Completion>& out) override {
    s.clock.sleep_for(timeout);
    run_until_now();
    fill_fifo();
    hand_over();
    out.insert(out.end(), done_.begin(), done_.end());
    done_.clear();
  }

 private:
  struct In {
    std::span<std::byte> buffer;
    std::uint64_t token;
  };
  struct Out {
    std::span<const std::byte> buffer;
    std::uint64_t token;
    std::size_t taken;
  };

  LinkStatus note(const ControlRequest& r, std::span<const std::byte> data) {
    const std::byte head[] = {std::byte{r.request_type}, std::byte{r.request}};
    std::byte words[4];
    store_le(r.value, std::span(words).first(2));
    store_le(r.index, std::span(words).last(2));
    const auto text = hex_of(head) + " " + hex_of(words) + " " + hex_of(data);
    s.requests.push_back(text);
    if (s.gone) return LinkStatus::no_device;
    return s.refuse ? s.refuse(text) : LinkStatus::ok;
  }

  void begin_scans() {
    input_running_ = true;
    began_ = s.clock.now();
    tick_ = 0;
  }

  void fill_fifo() {
    while (!out_.empty() && !s.starve_output) {
      auto& t = out_.front();
      while (t.taken < t.buffer.size() && fifo_.size() < 2048) {
        fifo_.push_back(load_le<std::uint16_t>(t.buffer.subspan(t.taken)));
        t.taken += 2;
      }
      if (t.taken < t.buffer.size()) return;
      done_.push_back({t.token, LinkStatus::ok, t.buffer.size()});
      out_.pop_front();
    }
  }

  void run_until_now() {
    if (!input_running_ || s.gone) return;
    const auto due = static_cast<std::int64_t>(std::chrono::duration<double>(s.clock.now() - began_).count() *
                                               64e6 / static_cast<double>(period_));
    for (; tick_ < due; ++tick_) {
      if (tick_ == s.unplug_at) return unplug();
      if (tick_ == s.overrun_at) overrun_ = true;
      if (tick_ == s.rotate_at) stream_.insert(stream_.end(), {std::byte{1}, std::byte{2}});
      if (s.silent_at >= 0 && tick_ >= s.silent_at) continue;
      if (tick_ == s.stall_at && !in_.empty()) {
        done_.push_back({in_.front().token, LinkStatus::stall, 0});
        in_.pop_front();
      }
      for (std::size_t c = 0; c < width_; ++c) {
        const auto place = (c + s.rotation) % width_;
        const std::uint16_t code = place + 1 == width_ ? s.marker
                                   : place == 0        ? (s.monitor ? s.output : 0x8000)
                                   : place == 1        ? counter(static_cast<std::uint64_t>(tick_))
                                                       : std::uint16_t{0x8000};
        append_le(code, stream_);
      }
      if (!output_running_) continue;
      fill_fifo();
      if (fifo_.empty()) {
        underrun_ = true;
        continue;
      }
      s.output = fifo_.front();
      s.played.push_back(s.output);
      fifo_.pop_front();
    }
  }

  void unplug() {
    s.gone = true;
    for (const auto& t : in_) done_.push_back({t.token, LinkStatus::no_device, 0});
    for (const auto& t : out_) done_.push_back({t.token, LinkStatus::no_device, 0});
    in_.clear();
    out_.clear();
  }

  void hand_over() {
    const auto packet = s.odd_packets > 0 ? s.odd_packets : packet_bytes_;
    while (!in_.empty() && stream_.size() >= packet) {
      auto& t = in_.front();
      std::size_t moved = 0;
      while (moved + packet <= t.buffer.size() && stream_.size() >= packet) {
        std::copy_n(stream_.begin(), packet, t.buffer.begin() + static_cast<std::ptrdiff_t>(moved));
        stream_.erase(stream_.begin(), stream_.begin() + static_cast<std::ptrdiff_t>(packet));
        moved += packet;
        if (packet % 512 != 0) break;
      }
      if (moved < t.buffer.size() && packet % 512 == 0) {
        // A transfer of full packets waits until it is full.
        stream_.insert(stream_.begin(), t.buffer.begin(),
                       t.buffer.begin() + static_cast<std::ptrdiff_t>(moved));
        return;
      }
      done_.push_back({t.token, LinkStatus::ok, moved});
      in_.pop_front();
    }
  }

  FakeState& s;
  std::deque<In> in_;
  std::deque<Out> out_;
  std::deque<std::uint16_t> fifo_;
  std::vector<std::byte> stream_;
  std::vector<Completion> done_;
  bool input_armed_ = false, input_running_ = false, output_running_ = false, external_clock_ = false;
  bool overrun_ = false, underrun_ = false;
  std::uint64_t period_ = 1;
  std::size_t packet_bytes_ = 512, width_ = 1;
  std::int64_t tick_ = 0;
  std::uint16_t address_ = 0;
  HostClock::TimePoint began_;
};

// Calibration of a perfect unit.
inline void calibrate(FakeState& s, float slope = 1, float offset = 0) {
  const auto put = [&](std::uint16_t address, float value) {
    std::byte bytes[4];
    store_le(std::bit_cast<std::uint32_t>(value), std::span(bytes));
    for (std::uint16_t i = 0; i < 4; ++i) s.eeprom[static_cast<std::uint16_t>(address + i)] = bytes[i];
  };
  for (std::uint16_t i = 0; i < 4; ++i) {
    put(static_cast<std::uint16_t>(0x7000 + 8 * i), slope);
    put(static_cast<std::uint16_t>(0x7004 + 8 * i), offset);
  }
  for (std::uint16_t i = 0; i < 2; ++i) {
    put(static_cast<std::uint16_t>(0x7080 + 8 * i), slope);
    put(static_cast<std::uint16_t>(0x7084 + 8 * i), offset);
  }
}

}  // namespace ferrobench::daq::usb
