// The host controller's side of one unit: transfers made of packets, moved frame by frame of its speed.
//
// Every transport (in process, usbfs, USB/IP) hands its transfers to a Port and advances its time. A transfer
// ends when it is full, at a short packet, when it is cancelled, when its endpoint halts or the unit is gone.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "unit/unit.h"

namespace ferrobench::emulator {

enum class Outcome { ok, stall, gone, babble, cancelled };

struct Finished {
  std::uint64_t id = 0;
  std::uint8_t endpoint = 0;
  Outcome outcome = Outcome::ok;
  std::size_t moved = 0;        // bytes
  std::vector<std::byte> data;  // what an IN transfer brought
};

class Port {
 public:
  static constexpr Ticks microframe = ticks_per_second / 8000;

  explicit Port(Unit& unit) : unit_(unit) {}

  Unit& unit() { return unit_; }
  Ticks now() const { return unit_.now(); }
  // `id` must not be under way already. False: there is no such endpoint.
  bool submit_in(std::uint64_t id, std::uint8_t endpoint, std::size_t length);
  bool submit_out(std::uint64_t id, std::uint8_t endpoint, std::span<const std::byte> data);
  // It finishes as cancelled with what has moved. False: it is not under way.
  bool cancel(std::uint64_t id);
  void cancel_all();
  // Control transfers take effect at once. gone, stall, or ok with the answer.
  Outcome control(const Request& request, std::span<const std::byte> data, std::vector<std::byte>& answer);

  void advance(Ticks to);
  // The transfers that finished, oldest first; each is given once.
  std::vector<Finished> take_finished();
  bool has_finished() const { return !finished_.empty(); }
  std::size_t in_under_way() const { return in_.size(); }
  std::size_t out_under_way() const { return out_.size(); }
  std::size_t under_way() const { return in_.size() + out_.size(); }

 private:
  struct Transfer {
    std::uint64_t id;
    std::uint8_t endpoint;
    std::size_t length, moved;
    std::vector<std::byte> data;
  };
  void move();
  bool move_in();
  bool move_out();
  void finish(std::deque<Transfer>& queue, Outcome outcome);

  bool high_speed() const { return unit_.setup().speed == Speed::high; }
  // Bulk packets in a frame: of 512 bytes in 125 us, or of 64 bytes in 1 ms.
  unsigned packets_per_frame() const { return high_speed() ? 13 : 19; }
  Ticks frame() const { return high_speed() ? microframe : 8 * microframe; }

  Unit& unit_;
  std::deque<Transfer> in_, out_;
  std::vector<Finished> finished_;
  std::vector<std::byte> packet_;
  unsigned budget_ = packets_per_frame();
};

}  // namespace ferrobench::emulator
