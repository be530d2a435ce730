#include "host/process_link.h"

#include <algorithm>
#include <thread>

#include "unit/requests.h"

namespace ferrobench::emulator {

using daq::usb::Completion;
using daq::usb::LinkStatus;

namespace {

LinkStatus status_of(Outcome outcome) {
  switch (outcome) {
    case Outcome::ok:
      return LinkStatus::ok;
    case Outcome::stall:
      return LinkStatus::stall;
    case Outcome::gone:
      return LinkStatus::no_device;
    case Outcome::babble:
      return LinkStatus::overflow;
    case Outcome::cancelled:
      return LinkStatus::cancelled;
  }
  return LinkStatus::error;
}

constexpr Ticks ticks_of(std::chrono::nanoseconds time) {
  return static_cast<Ticks>(time.count()) * (ticks_per_second / 1'000'000) / 1000;
}

}  // namespace

ProcessLink::ProcessLink(Port& port, Pace pace)
    : port_(port),
      pace_(pace),
      begin_(Clock::now()),
      begin_ticks_(port.now()),
      departures_(port.unit().departures()) {}

ProcessLink::~ProcessLink() {
  port_.cancel_all();
  port_.take_finished();
}

daq::usb::DeviceId ProcessLink::id() const {
  const UnitSetup& setup = port_.unit().setup();
  return {.vendor = vendor_id,
          .product = setup.product,
          .firmware = setup.firmware,
          .serial = setup.serial,
          .path = "in-process"};
}

std::size_t ProcessLink::packet_bytes(std::uint8_t endpoint) const {
  const bool known = endpoint == input_endpoint || endpoint == output_endpoint;
  return known ? port_.unit().setup().max_packet() : 0;
}

void ProcessLink::keep_up() {
  if (pace_ == Pace::fast) {
    port_.advance(port_.now() + control_time);
    return;
  }
  const Ticks due = begin_ticks_ + ticks_of(Clock::now() - begin_);
  if (due > port_.now()) port_.advance(due);
}

LinkStatus ProcessLink::control(const Request& request, std::span<const std::byte> data,
                                std::vector<std::byte>& answer) {
  keep_up();
  if (gone()) return LinkStatus::no_device;
  return status_of(port_.control(request, data, answer));
}

LinkStatus ProcessLink::control_out(const daq::usb::ControlRequest& request, std::span<const std::byte> data,
                                    std::chrono::milliseconds) {
  std::vector<std::byte> answer;
  return control({.type = request.request_type,
                  .number = request.request,
                  .value = request.value,
                  .index = request.index,
                  .length = static_cast<std::uint16_t>(data.size())},
                 data, answer);
}

LinkStatus ProcessLink::control_in(const daq::usb::ControlRequest& request, std::span<std::byte> data,
                                   std::size_t& actual, std::chrono::milliseconds) {
  std::vector<std::byte> answer;
  const LinkStatus status = control({.type = request.request_type,
                                     .number = request.request,
                                     .value = request.value,
                                     .index = request.index,
                                     .length = static_cast<std::uint16_t>(data.size())},
                                    {}, answer);
  actual = std::min(answer.size(), data.size());
  std::copy_n(answer.begin(), actual, data.begin());
  return status;
}

LinkStatus ProcessLink::clear_halt(std::uint8_t endpoint) {
  std::vector<std::byte> answer;
  return control({.type = 0x02, .number = 0x01, .value = 0, .index = endpoint, .length = 0}, {}, answer);
}

LinkStatus ProcessLink::submit_in(std::uint8_t endpoint, std::span<std::byte> buffer, std::uint64_t token) {
  if (gone()) return LinkStatus::no_device;
  pending_[next_id_] = {.token = token, .buffer = buffer};
  if (port_.submit_in(next_id_++, endpoint, buffer.size())) return LinkStatus::ok;
  pending_.erase(next_id_ - 1);
  return LinkStatus::error;
}

LinkStatus ProcessLink::submit_out(std::uint8_t endpoint, std::span<const std::byte> buffer,
                                   std::uint64_t token) {
  if (gone()) return LinkStatus::no_device;
  pending_[next_id_] = {.token = token, .buffer = {}};
  if (port_.submit_out(next_id_++, endpoint, buffer)) return LinkStatus::ok;
  pending_.erase(next_id_ - 1);
  return LinkStatus::error;
}

void ProcessLink::wait(std::chrono::milliseconds timeout, std::vector<Completion>& out) {
  if (pace_ == Pace::fast) {
    const Ticks end = port_.now() + ticks_of(timeout);
    while (!port_.has_finished() && port_.now() < end)
      port_.advance(std::min(end, port_.now() + Port::microframe));
  } else {
    const auto end = Clock::now() + timeout;
    keep_up();
    while (!port_.has_finished() && Clock::now() < end) {
      std::this_thread::sleep_for(
          std::min<Clock::duration>(std::chrono::milliseconds(1), end - Clock::now()));
      keep_up();
    }
  }
  for (const Finished& f : port_.take_finished()) {
    const auto at = pending_.find(f.id);
    if (at == pending_.end()) continue;
    std::copy(f.data.begin(), f.data.end(), at->second.buffer.begin());
    out.push_back({.token = at->second.token, .status = status_of(f.outcome), .actual = f.moved});
    pending_.erase(at);
  }
}

}  // namespace ferrobench::emulator
