#include "usbfs/usbfs.h"

#include <sys/ioctl.h>
// After the header above, whose macros it uses.
#include <linux/usbdevice_fs.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>

#include "host/kernel_status.h"
#include "unit/bytes.h"
#include "unit/requests.h"

namespace ferrobench::emulator {

namespace {

constexpr std::size_t most_bytes = std::size_t{1} << 24;  // of a transfer
constexpr std::size_t setup_packet = 8;

template <class T>
T load(const UMockdevIoctlData& data) {
  T value;
  std::memcpy(&value, data.data, sizeof value);
  return value;
}

std::vector<std::byte> contents(const UMockdevIoctlData& data) {
  const auto* begin = reinterpret_cast<const std::byte*>(data.data);
  return {begin, begin + data.data_len};
}

void store(UMockdevIoctlData& data, std::size_t offset, const void* from, std::size_t size) {
  std::vector<guint8> copy(size);
  std::memcpy(copy.data(), from, size);
  umockdev_ioctl_data_update(&data, offset, copy.data(), static_cast<gint>(size));
}

// The client's memory that the pointer at `offset` points to, or null.
UMockdevIoctlData* follow(UMockdevIoctlData& data, std::size_t offset, std::size_t length) {
  GError* error = nullptr;
  UMockdevIoctlData* found = umockdev_ioctl_data_resolve(&data, offset, length, &error);
  if (error != nullptr) g_error_free(error);
  return found;
}

int status_of(Outcome outcome) {
  return kernel_status(outcome, -ENOENT);
}

Request request_of(std::span<const std::byte> setup) {
  return {.type = std::to_integer<std::uint8_t>(setup[0]),
          .number = std::to_integer<std::uint8_t>(setup[1]),
          .value = get16(setup.subspan(2)),
          .index = get16(setup.subspan(4)),
          .length = get16(setup.subspan(6))};
}

}  // namespace

int Usbfs::ioctl(std::uint64_t client, unsigned long request, UMockdevIoctlData& arg) {
  client_ = client;
  if (request == USBDEVFS_REAPURB || request == USBDEVFS_REAPURBNDELAY) return reap(arg);
  if (request == USBDEVFS_DISCARDURB) return discard(arg);
  if (gone()) return -ENODEV;
  switch (request) {
    case USBDEVFS_SUBMITURB:
      return submit(arg);
    case USBDEVFS_CONTROL:
      return control(arg);
    case USBDEVFS_CLEAR_HALT:
      return clear_halt(arg);
    case USBDEVFS_GET_CAPABILITIES:
      return capabilities(arg);
    case USBDEVFS_GETDRIVER:
      return -ENODATA;  // no kernel driver holds the interface
    case USBDEVFS_CLAIMINTERFACE:
      // One process holds the interface at a time: what one that died had under way ends with it. Else its
      // transfers would take the first ticks of the next one's scan.
      port_.cancel_all();
      collect();
      std::erase_if(done_, [client](const Done& done) { return done.client != client; });
      return 0;
    case USBDEVFS_RELEASEINTERFACE:
    case USBDEVFS_DISCONNECT_CLAIM:
    case USBDEVFS_SETCONFIGURATION:
    case USBDEVFS_SETINTERFACE:
      return 0;
    case USBDEVFS_RESET:
      port_.cancel_all();
      return 0;
    default:
      return -ENOTTY;
  }
}

int Usbfs::capabilities(UMockdevIoctlData& arg) {
  constexpr std::uint32_t offered =
      USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_NO_PACKET_SIZE_LIM | USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
  const Data where(follow(arg, 0, sizeof offered));
  if (!where) return -EFAULT;
  store(*where, 0, &offered, sizeof offered);
  return 0;
}

int Usbfs::clear_halt(UMockdevIoctlData& arg) {
  const Data where(follow(arg, 0, sizeof(unsigned)));
  if (!where) return -EFAULT;
  std::vector<std::byte> answer;
  const Request request{.type = 0x02,
                        .number = 0x01,
                        .value = 0,
                        .index = static_cast<std::uint16_t>(load<unsigned>(*where) & 0xFFU),
                        .length = 0};
  return port_.control(request, {}, answer) == Outcome::ok ? 0 : -ENOENT;
}

int Usbfs::control(UMockdevIoctlData& arg) {
  const Data where(follow(arg, 0, sizeof(usbdevfs_ctrltransfer)));
  if (!where) return -EFAULT;
  const auto transfer = load<usbdevfs_ctrltransfer>(*where);
  const bool in = (transfer.bRequestType & 0x80U) != 0;
  const Data buffer(transfer.wLength == 0
                        ? nullptr
                        : follow(*where, offsetof(usbdevfs_ctrltransfer, data), transfer.wLength));
  if (transfer.wLength != 0 && !buffer) return -EFAULT;
  std::vector<std::byte> data, answer;
  if (!in && buffer) data = contents(*buffer);
  const Outcome outcome = forward({.type = transfer.bRequestType,
                                   .number = transfer.bRequest,
                                   .value = transfer.wValue,
                                   .index = transfer.wIndex,
                                   .length = transfer.wLength},
                                  data, answer);
  if (outcome != Outcome::ok) return status_of(outcome);
  if (in && !answer.empty()) store(*buffer, 0, answer.data(), answer.size());
  return static_cast<int>(in ? answer.size() : data.size());
}

Outcome Usbfs::forward(const Request& request, std::span<const std::byte> data,
                       std::vector<std::byte>& answer) {
  const Outcome outcome = port_.control(request, data, answer);
  reset_ |=
      request.type == vendor_out && request.number == emulator::request::reset && outcome == Outcome::ok;
  return outcome;
}

int Usbfs::submit(UMockdevIoctlData& arg) {
  Data where(follow(arg, 0, sizeof(usbdevfs_urb)));
  if (!where) return -EFAULT;
  const auto urb = load<usbdevfs_urb>(*where);
  if (urb.buffer_length < 0 || static_cast<std::size_t>(urb.buffer_length) > most_bytes) return -EINVAL;
  const auto length = static_cast<std::size_t>(urb.buffer_length);
  switch (urb.type) {
    case USBDEVFS_URB_TYPE_CONTROL:
      return submit_control(std::move(where), length);
    case USBDEVFS_URB_TYPE_BULK:
      return submit_bulk(std::move(where), urb.endpoint, length);
    default:
      return -EINVAL;
  }
}

int Usbfs::submit_control(Data urb, std::size_t length) {
  if (length < setup_packet) return -EINVAL;
  const Data buffer(follow(*urb, offsetof(usbdevfs_urb, buffer), length));
  if (!buffer) return -EFAULT;
  const auto bytes = contents(*buffer);
  const Request request = request_of(bytes);
  if (setup_packet + request.length > length) return -EINVAL;
  const bool in = (request.type & 0x80U) != 0;
  const auto data = std::span(bytes).subspan(setup_packet, in ? 0 : request.length);
  std::vector<std::byte> answer;
  const Outcome outcome = forward(request, data, answer);
  const std::size_t moved = outcome != Outcome::ok ? 0 : in ? answer.size() : data.size();
  done_.push_back({.urb = std::move(urb),
                   .client = client_,
                   .status = status_of(outcome),
                   .bytes = std::move(answer),
                   .offset = setup_packet,
                   .moved = moved});
  return 0;
}

int Usbfs::submit_bulk(Data urb, std::uint8_t endpoint, std::size_t length) {
  const std::uint64_t id = next_++;
  if ((endpoint & 0x80U) != 0) {
    if (!port_.submit_in(id, endpoint, length)) return -ENOENT;
  } else {
    const Data buffer(length == 0 ? nullptr : follow(*urb, offsetof(usbdevfs_urb, buffer), length));
    if (length != 0 && !buffer) return -EFAULT;
    const auto bytes = buffer ? contents(*buffer) : std::vector<std::byte>{};
    if (!port_.submit_out(id, endpoint, bytes)) return -ENOENT;
  }
  submitted_[id] = {.urb = std::move(urb), .client = client_};
  collect();
  return 0;
}

void Usbfs::collect() {
  if (retired_) return;  // what finishes now was submitted through another node
  for (Finished& f : port_.take_finished()) {
    auto found = submitted_.extract(f.id);
    if (found.empty()) continue;
    done_.push_back({.urb = std::move(found.mapped().urb),
                     .client = found.mapped().client,
                     .status = status_of(f.outcome),
                     .bytes = std::move(f.data),
                     .offset = 0,
                     .moved = f.moved});
  }
}

int Usbfs::discard(const UMockdevIoctlData& arg) {
  const auto address = load<unsigned long>(arg);
  for (const auto& [id, submitted] : submitted_) {
    if (submitted.client != client_ || submitted.urb->client_addr != address) continue;
    port_.cancel(id);
    collect();
    return 0;
  }
  return -EINVAL;
}

int Usbfs::reap(UMockdevIoctlData& arg) {
  collect();
  const auto mine = std::ranges::find(done_, client_, &Done::client);
  if (mine == done_.end()) return gone() ? -ENODEV : -EAGAIN;
  const Data where(follow(arg, 0, sizeof(void*)));
  if (!where) return -EFAULT;
  Done done = std::move(*mine);
  done_.erase(mine);
  if (!done.bytes.empty()) {
    const Data buffer(follow(*done.urb, offsetof(usbdevfs_urb, buffer),
                             static_cast<std::size_t>(load<usbdevfs_urb>(*done.urb).buffer_length)));
    if (!buffer) return -EFAULT;
    store(*buffer, done.offset, done.bytes.data(), done.bytes.size());
  }
  const int moved = static_cast<int>(done.moved);
  store(*done.urb, offsetof(usbdevfs_urb, status), &done.status, sizeof done.status);
  store(*done.urb, offsetof(usbdevfs_urb, actual_length), &moved, sizeof moved);
  if (!umockdev_ioctl_data_set_ptr(where.get(), 0, done.urb.get())) return -EFAULT;
  return 0;
}

}  // namespace ferrobench::emulator
