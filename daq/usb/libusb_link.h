// The link through libusb: asynchronous transfers, whose events are handled in wait() on the caller's thread.
#pragma once

#include <libusb.h>

#include <deque>
#include <memory>

#include "daq/usb/link.h"

namespace ferrobench::daq::usb {

struct UsbContext {
  UsbContext();  // throws Error(device_unavailable)
  ~UsbContext() { libusb_exit(context); }
  UsbContext(const UsbContext&) = delete;
  UsbContext& operator=(const UsbContext&) = delete;
  libusb_context* context = nullptr;
};

LinkStatus link_status(int libusb_error);

class LibusbLink final : public Link {
 public:
  // Takes the handle over and claims interface 0. Throws Error(device_unavailable).
  LibusbLink(std::shared_ptr<UsbContext> context, libusb_device_handle* handle, DeviceId id);
  ~LibusbLink() override;
  LibusbLink(const LibusbLink&) = delete;
  LibusbLink& operator=(const LibusbLink&) = delete;

  DeviceId id() const override { return id_; }
  std::size_t packet_bytes(std::uint8_t endpoint) const override;
  LinkStatus control_out(const ControlRequest& request, std::span<const std::byte> data,
                         std::chrono::milliseconds timeout) override;
  LinkStatus control_in(const ControlRequest& request, std::span<std::byte> data, std::size_t& actual,
                        std::chrono::milliseconds timeout) override;
  LinkStatus clear_halt(std::uint8_t endpoint) override;
  LinkStatus submit_in(std::uint8_t endpoint, std::span<std::byte> buffer, std::uint64_t token) override;
  LinkStatus submit_out(std::uint8_t endpoint, std::span<const std::byte> buffer,
                        std::uint64_t token) override;
  void cancel_all() override;
  void wait(std::chrono::milliseconds timeout, std::vector<Completion>& out) override;

 private:
  struct Slot {
    LibusbLink* link = nullptr;
    libusb_transfer* transfer = nullptr;
    std::uint64_t token = 0;
    bool in_flight = false;
  };
  LinkStatus submit(std::uint8_t endpoint, std::byte* data, std::size_t size, std::uint64_t token);
  static void LIBUSB_CALL on_complete(libusb_transfer* transfer);

  std::shared_ptr<UsbContext> context_;
  libusb_device_handle* handle_;
  DeviceId id_;
  std::deque<Slot> slots_;
  std::size_t in_flight_ = 0;
  std::vector<Completion> completed_;
};

}  // namespace ferrobench::daq::usb
