// A link whose every answer comes out of a string of bytes; when that is used up, the unit is gone.
#pragma once

#include <algorithm>
#include <deque>

#include "tests/daq/usb/bench.h"
#include "tests/daq/usb/session.h"

namespace ferrobench::daq::usb {

class ByteLink final : public Link {
 public:
  ByteLink(std::span<const std::byte>& answers, FakeClock& clock) : answers_(answers), clock_(clock) {
    const auto first = draw();
    id_ = {vendor_id, static_cast<std::uint16_t>(first < 250 ? 0x0136 : 0x0100 + first - 250), 1,
           std::string(first % 7, static_cast<char>(first)), ""};
    tame_ = draw() < 200;
    if (const auto drawn = draw(); drawn >= 240) packet_ = drawn < 250 ? 64 : drawn;
  }

  DeviceId id() const override { return id_; }
  std::size_t packet_bytes(std::uint8_t) const override { return packet_; }
  LinkStatus control_out(const ControlRequest& r, std::span<const std::byte>,
                         std::chrono::milliseconds) override {
    if (r.request == 0x02) started_ = (r.value & 1) != 0;
    return status();
  }
  LinkStatus control_in(const ControlRequest& r, std::span<std::byte> data, std::size_t& actual,
                        std::chrono::milliseconds) override {
    actual = draw() < 250 ? data.size() : draw();
    const bool memory = r.request == 0x30, word = r.request == 0x40;
    for (std::size_t i = 0; i < data.size(); ++i) {
      // A tame unit has slopes of 1 and is configured and running.
      constexpr std::byte one[] = {std::byte{0}, std::byte{0}, std::byte{0x80}, std::byte{0x3F}};
      const auto drawn = static_cast<std::byte>(draw());
      data[i] = !tame_ ? drawn : memory ? (i % 8 < 4 ? one[i % 4] : std::byte{0}) : drawn;
    }
    if (tame_ && data.size() >= 2 && data[0] < std::byte{0xF0}) {
      if (word) data[0] = std::byte{0x0A}, data[1] = std::byte{1};
      if (r.request == 0x18) data[0] = std::byte{0}, data[1] = std::byte{0x80};  // the output rests
    }
    return status();
  }
  LinkStatus clear_halt(std::uint8_t) override { return status(); }
  LinkStatus submit_in(std::uint8_t, std::span<std::byte> buffer, std::uint64_t token) override {
    const auto s = status();
    if (s == LinkStatus::ok) in_.push_back({buffer, token});
    return s;
  }
  LinkStatus submit_out(std::uint8_t, std::span<const std::byte> buffer, std::uint64_t token) override {
    const auto s = status();
    if (s == LinkStatus::ok) out_.push_back({buffer.size(), token});
    return s;
  }
  void cancel_all() override { cancelled_ = true; }

  void wait(std::chrono::milliseconds timeout, std::vector<Completion>& out) override {
    clock_.sleep_for(std::max(timeout, std::chrono::milliseconds(1)));
    if (cancelled_) {
      // Some links never give everything back.
      if (draw() == 255) return;
      for (const auto& t : in_) out.push_back({t.second, LinkStatus::cancelled, 0});
      for (const auto& t : out_) out.push_back({t.second, LinkStatus::cancelled, 0});
      in_.clear();
      out_.clear();
      cancelled_ = false;
      return;
    }
    for (auto count = draw() % 4; count > 0; --count) {
      if (draw() > 250) out.push_back({draw(), status(), draw()});
      if (!out_.empty()) {
        const auto [size, token] = out_.front();
        out_.pop_front();
        out.push_back({token, status(), draw() < 250 ? size : draw()});
      }
      if (in_.empty() || (tame_ && !started_)) continue;
      const auto which = draw() < 250 ? 0 : draw() % in_.size();
      const auto [buffer, token] = in_[which];
      in_.erase(in_.begin() + static_cast<std::ptrdiff_t>(which));
      // A few whole ticks at rest with the marker at its level, unless the bytes say otherwise.
      const auto actual = draw() < 250 ? std::min(buffer.size(), 8 * (1 + draw() % 16)) : draw() * draw();
      constexpr std::byte rest[] = {std::byte{0}, std::byte{0x80}, std::byte{0}, std::byte{0x80},
                                    std::byte{0}, std::byte{0x80}, std::byte{0}, std::byte{0xC0}};
      const bool wild = draw() > 240;
      for (std::size_t i = 0; i < std::min(actual, buffer.size()); ++i)
        buffer[i] = wild ? static_cast<std::byte>(draw()) : rest[i % 8];
      out.push_back({token, status(), actual});
    }
  }

 private:
  std::size_t draw() {
    if (answers_.empty()) return 255;
    const auto value = static_cast<std::size_t>(answers_.front());
    answers_ = answers_.subspan(1);
    return value;
  }
  LinkStatus status() {
    if (answers_.empty()) return LinkStatus::no_device;
    const auto value = draw();
    return value < 249 ? LinkStatus::ok : static_cast<LinkStatus>(value - 249);
  }

  std::span<const std::byte>& answers_;
  FakeClock& clock_;
  DeviceId id_;
  std::size_t packet_ = 512;
  bool tame_ = false, cancelled_ = false, started_ = false;
  std::deque<std::pair<std::span<std::byte>, std::uint64_t>> in_;
  std::deque<std::pair<std::size_t, std::uint64_t>> out_;
};

}  // namespace ferrobench::daq::usb
