// The seam between the driver and what carries its transfers: libusb, or an emulated unit in the same
// process.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace ferrobench::daq::usb {

// What a transfer or request came to.
enum class LinkStatus { ok, stall, timeout, no_device, overflow, cancelled, error };

struct DeviceId {
  std::uint16_t vendor, product, firmware;
  std::string serial, path;
};

struct ControlRequest {
  std::uint8_t request_type, request;
  std::uint16_t value, index;
};

struct Completion {
  std::uint64_t token;
  LinkStatus status;
  std::size_t actual;  // bytes moved
};

// One opened unit, interface claimed. All calls from one thread. Buffers handed to submit_* stay the caller's
// and must live until their completion is given by wait().
class Link {
 public:
  virtual ~Link() = default;
  virtual DeviceId id() const = 0;
  virtual LinkStatus control_out(const ControlRequest&, std::span<const std::byte> data,
                                 std::chrono::milliseconds timeout) = 0;
  virtual LinkStatus control_in(const ControlRequest&, std::span<std::byte> data, std::size_t& actual,
                                std::chrono::milliseconds timeout) = 0;
  virtual LinkStatus clear_halt(std::uint8_t endpoint) = 0;
  virtual LinkStatus submit_in(std::uint8_t endpoint, std::span<std::byte> buffer, std::uint64_t token) = 0;
  virtual LinkStatus submit_out(std::uint8_t endpoint, std::span<const std::byte> buffer,
                                std::uint64_t token) = 0;
  virtual void cancel_all() = 0;  // every submitted transfer then completes as cancelled through wait()
  // Completions that have come, waiting up to `timeout` for the first; appends to `out`.
  virtual void wait(std::chrono::milliseconds timeout, std::vector<Completion>& out) = 0;
};

}  // namespace ferrobench::daq::usb
