#include "daq/usb/libusb_link.h"

#include <algorithm>
#include <thread>

#include "base/error.h"

namespace ferrobench::daq::usb {

namespace {

timeval to_timeval(std::chrono::milliseconds time) {
  return {.tv_sec = static_cast<time_t>(time.count() / 1000),
          .tv_usec = static_cast<suseconds_t>(time.count() % 1000 * 1000)};
}

LinkStatus transfer_status(libusb_transfer_status status) {
  switch (status) {
    case LIBUSB_TRANSFER_COMPLETED:
      return LinkStatus::ok;
    case LIBUSB_TRANSFER_STALL:
      return LinkStatus::stall;
    case LIBUSB_TRANSFER_TIMED_OUT:
      return LinkStatus::timeout;
    case LIBUSB_TRANSFER_CANCELLED:
      return LinkStatus::cancelled;
    case LIBUSB_TRANSFER_NO_DEVICE:
      return LinkStatus::no_device;
    case LIBUSB_TRANSFER_OVERFLOW:
      return LinkStatus::overflow;
    default:
      return LinkStatus::error;
  }
}

}  // namespace

UsbContext::UsbContext() {
  if (const int error = libusb_init(&context); error != LIBUSB_SUCCESS)
    throw Error(ErrorCode::device_unavailable, std::string("USB cannot be used: ") + libusb_strerror(error),
                Problem{.hint = "check that this machine has USB and that /dev/bus/usb is there"});
}

LinkStatus link_status(int error) {
  switch (error) {
    case LIBUSB_SUCCESS:
      return LinkStatus::ok;
    case LIBUSB_ERROR_PIPE:
      return LinkStatus::stall;
    case LIBUSB_ERROR_TIMEOUT:
      return LinkStatus::timeout;
    case LIBUSB_ERROR_NO_DEVICE:
      return LinkStatus::no_device;
    case LIBUSB_ERROR_OVERFLOW:
      return LinkStatus::overflow;
    default:
      return LinkStatus::error;
  }
}

LibusbLink::LibusbLink(std::shared_ptr<UsbContext> context, libusb_device_handle* handle, DeviceId id)
    : context_(std::move(context)), handle_(handle), id_(std::move(id)) {
  const int error = libusb_claim_interface(handle_, 0);
  if (error == LIBUSB_SUCCESS) return;
  libusb_close(handle_);
  throw Error(ErrorCode::device_unavailable, "USB unit " + id_.serial + " cannot be claimed",
              Problem{.message = libusb_strerror(error),
                      .hint = error == LIBUSB_ERROR_BUSY ? "another program uses it: end that first"
                                                         : "unplug the unit and plug it in again"});
}

LibusbLink::~LibusbLink() {
  cancel_all();
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(2);
  std::vector<Completion> ignored;
  while (in_flight_ > 0 && std::chrono::steady_clock::now() < end)
    wait(std::chrono::milliseconds(10), ignored);
  if (in_flight_ == 0) {
    libusb_release_interface(handle_, 0);
    for (auto& slot : slots_) libusb_free_transfer(slot.transfer);
  }
  // Transfers that never came back belong to the kernel until the handle is closed; their records stay.
  libusb_close(handle_);
}

std::size_t LibusbLink::packet_bytes(std::uint8_t endpoint) const {
  return static_cast<std::size_t>(
      std::max(0, libusb_get_max_packet_size(libusb_get_device(handle_), endpoint)));
}

LinkStatus LibusbLink::control_out(const ControlRequest& r, std::span<const std::byte> data,
                                   std::chrono::milliseconds timeout) {
  // libusb has one form for both directions and does not write to what goes out.
  auto* bytes = const_cast<unsigned char*>(reinterpret_cast<const unsigned char*>(data.data()));
  const int moved = libusb_control_transfer(handle_, r.request_type, r.request, r.value, r.index, bytes,
                                            static_cast<std::uint16_t>(data.size()),
                                            static_cast<unsigned>(timeout.count()));
  if (moved < 0) return link_status(moved);
  return static_cast<std::size_t>(moved) == data.size() ? LinkStatus::ok : LinkStatus::error;
}

LinkStatus LibusbLink::control_in(const ControlRequest& r, std::span<std::byte> data, std::size_t& actual,
                                  std::chrono::milliseconds timeout) {
  actual = 0;
  const int moved = libusb_control_transfer(
      handle_, r.request_type, r.request, r.value, r.index, reinterpret_cast<unsigned char*>(data.data()),
      static_cast<std::uint16_t>(data.size()), static_cast<unsigned>(timeout.count()));
  if (moved < 0) return link_status(moved);
  actual = static_cast<std::size_t>(moved);
  return LinkStatus::ok;
}

LinkStatus LibusbLink::clear_halt(std::uint8_t endpoint) {
  return link_status(libusb_clear_halt(handle_, endpoint));
}

LinkStatus LibusbLink::submit_in(std::uint8_t endpoint, std::span<std::byte> buffer, std::uint64_t token) {
  return submit(endpoint, buffer.data(), buffer.size(), token);
}

LinkStatus LibusbLink::submit_out(std::uint8_t endpoint, std::span<const std::byte> buffer,
                                  std::uint64_t token) {
  return submit(endpoint, const_cast<std::byte*>(buffer.data()), buffer.size(), token);
}

LinkStatus LibusbLink::submit(std::uint8_t endpoint, std::byte* data, std::size_t size, std::uint64_t token) {
  auto found = std::ranges::find_if(slots_, [](const auto& s) { return !s.in_flight; });
  if (found == slots_.end()) {
    auto* transfer = libusb_alloc_transfer(0);
    if (transfer == nullptr) return LinkStatus::error;
    slots_.push_back({.link = this, .transfer = transfer});
    found = slots_.end() - 1;
    completed_.reserve(slots_.size());
  }
  auto& slot = *found;
  libusb_fill_bulk_transfer(slot.transfer, handle_, endpoint, reinterpret_cast<unsigned char*>(data),
                            static_cast<int>(size), on_complete, &slot, 0);
  const int error = libusb_submit_transfer(slot.transfer);
  if (error != LIBUSB_SUCCESS) return link_status(error);
  slot.token = token;
  slot.in_flight = true;
  ++in_flight_;
  return LinkStatus::ok;
}

void LibusbLink::on_complete(libusb_transfer* transfer) {
  auto& slot = *static_cast<Slot*>(transfer->user_data);
  auto& link = *slot.link;
  slot.in_flight = false;
  --link.in_flight_;
  link.completed_.push_back({.token = slot.token,
                             .status = transfer_status(transfer->status),
                             .actual = static_cast<std::size_t>(std::max(transfer->actual_length, 0))});
}

void LibusbLink::cancel_all() {
  for (auto& slot : slots_)
    if (slot.in_flight)
      libusb_cancel_transfer(slot.transfer);  // one that has just ended says so, which is fine
}

void LibusbLink::wait(std::chrono::milliseconds timeout, std::vector<Completion>& out) {
  if (completed_.empty()) {
    auto time = to_timeval(timeout);
    const int error = libusb_handle_events_timeout_completed(context_->context, &time, nullptr);
    // An error comes at once; without a rest the caller would spin.
    if (error != LIBUSB_SUCCESS && error != LIBUSB_ERROR_INTERRUPTED)
      std::this_thread::sleep_for(std::min(timeout, std::chrono::milliseconds(1)));
  }
  out.insert(out.end(), completed_.begin(), completed_.end());
  completed_.clear();
}

}  // namespace ferrobench::daq::usb
