// The driver's link to a unit in the same process.
//
// fast: waiting is what lets the unit's time pass, so a run takes what it takes to compute and is the same
// every time. real: the unit's time follows the clock.
#pragma once

#include <chrono>
#include <map>

#include "daq/usb/link.h"
#include "host/port.h"

namespace ferrobench::emulator {

enum class Pace { fast, real };

class ProcessLink final : public daq::usb::Link {
 public:
  // What a control transfer takes in the unit's time when the pace is fast: a typical round trip.
  static constexpr Ticks control_time = 3 * Port::microframe;

  ProcessLink(Port& port, Pace pace);
  ~ProcessLink() override;  // as closing a device: what is under way is cancelled
  ProcessLink(const ProcessLink&) = delete;
  ProcessLink& operator=(const ProcessLink&) = delete;

  daq::usb::DeviceId id() const override;
  std::size_t packet_bytes(std::uint8_t endpoint) const override;
  daq::usb::LinkStatus control_out(const daq::usb::ControlRequest& request, std::span<const std::byte> data,
                                   std::chrono::milliseconds timeout) override;
  daq::usb::LinkStatus control_in(const daq::usb::ControlRequest& request, std::span<std::byte> data,
                                  std::size_t& actual, std::chrono::milliseconds timeout) override;
  daq::usb::LinkStatus clear_halt(std::uint8_t endpoint) override;
  daq::usb::LinkStatus submit_in(std::uint8_t endpoint, std::span<std::byte> buffer,
                                 std::uint64_t token) override;
  daq::usb::LinkStatus submit_out(std::uint8_t endpoint, std::span<const std::byte> buffer,
                                  std::uint64_t token) override;
  void cancel_all() override { port_.cancel_all(); }
  void wait(std::chrono::milliseconds timeout, std::vector<daq::usb::Completion>& out) override;

 private:
  using Clock = std::chrono::steady_clock;
  // As with any host: a unit that comes back is another one, this link stays dead.
  bool gone() const { return !port_.unit().on_bus() || port_.unit().departures() != departures_; }
  void keep_up();  // with the clock, or by a control transfer's time
  daq::usb::LinkStatus control(const Request& request, std::span<const std::byte> data,
                               std::vector<std::byte>& answer);

  struct Pending {
    std::uint64_t token;
    std::span<std::byte> buffer;
  };
  Port& port_;
  Pace pace_;
  Clock::time_point begin_;
  Ticks begin_ticks_;
  unsigned departures_;  // of the unit, when this link was made
  std::uint64_t next_id_ = 0;
  std::map<std::uint64_t, Pending> pending_;
};

}  // namespace ferrobench::emulator
