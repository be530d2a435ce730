// The link to one opened unit: vendor requests and bulk transfers, and nothing of what they mean. Everything
// above it is the same whether libusb, an emulator or a test answers.
//
// All calls come from one thread at a time. Buffers handed to submit_* stay the caller's and must live until
// their completion is given by wait().
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace ferrobench::daq::usb {

// What a transfer or request came to.
enum class LinkStatus { ok, stall, timeout, no_device, overflow, cancelled, error };
std::string_view link_status_name(LinkStatus status);

struct DeviceId {
  std::uint16_t vendor = 0, product = 0, firmware = 0;
  std::string serial{}, path{};
};

struct ControlRequest {
  std::uint8_t request_type = 0, request = 0;
  std::uint16_t value = 0, index = 0;
};

struct Completion {
  std::uint64_t token = 0;
  LinkStatus status = LinkStatus::ok;
  std::size_t actual = 0;  // bytes moved
};

class Link {
 public:
  virtual ~Link() = default;
  virtual DeviceId id() const = 0;
  // Bytes in the longest packet of an endpoint, as its descriptor says; 0: there is no such endpoint.
  virtual std::size_t packet_bytes(std::uint8_t endpoint) const = 0;
  virtual LinkStatus control_out(const ControlRequest& request, std::span<const std::byte> data,
                                 std::chrono::milliseconds timeout) = 0;
  virtual LinkStatus control_in(const ControlRequest& request, std::span<std::byte> data, std::size_t& actual,
                                std::chrono::milliseconds timeout) = 0;
  virtual LinkStatus clear_halt(std::uint8_t endpoint) = 0;
  virtual LinkStatus submit_in(std::uint8_t endpoint, std::span<std::byte> buffer, std::uint64_t token) = 0;
  virtual LinkStatus submit_out(std::uint8_t endpoint, std::span<const std::byte> buffer,
                                std::uint64_t token) = 0;
  // Every submitted transfer then completes as cancelled through wait().
  virtual void cancel_all() = 0;
  // Completions that have come, waiting up to `timeout` for the first; appends to `out`.
  virtual void wait(std::chrono::milliseconds timeout, std::vector<Completion>& out) = 0;
};

}  // namespace ferrobench::daq::usb
