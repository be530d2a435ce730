#include "usbip/session.h"

#include <cerrno>

#include "host/kernel_status.h"
#include "unit/bytes.h"
#include "unit/requests.h"

namespace ferrobench::emulator::usbip {

namespace {

int status_of(Outcome outcome) {
  return kernel_status(outcome, -ECONNRESET);
}

}  // namespace

void Session::receive(std::span<const std::byte> bytes) {
  in_.insert(in_.end(), bytes.begin(), bytes.end());
  while (!closed_ && (imported_ ? command() : operation())) {
  }
  collect();
}

void Session::describe_device(Writer& out, bool with_interfaces) const {
  const UnitSetup& setup = port_.unit().setup();
  out.text("/sys/devices/pci0000:00/0000:00:14.0/usb1/1-1", path_size).text(bus_id, bus_id_size);
  out.u32(device_id >> 16).u32(device_id & 0xFFFFU).u32(setup.speed == Speed::high ? high_speed : full_speed);
  out.u16(vendor_id).u16(setup.product).u16(setup.firmware);
  // Class, subclass and protocol of the device; configuration 1 of 1; one interface.
  out.u8(0xFF).u8(0).u8(0).u8(1).u8(1).u8(1);
  if (with_interfaces) out.u8(0xFF).u8(0).u8(0).u8(0);
}

bool Session::operation() {
  if (in_.size() < op_header) return false;
  const std::uint16_t code = get16_big(std::span(in_).subspan(2));
  if (get16_big(in_) != version) {
    closed_ = true;
    return false;
  }
  Writer out;
  if (code == devlist_request) {
    const bool present = port_.unit().on_bus();
    out.u16(version).u16(devlist_reply).u32(0).u32(present ? 1 : 0);
    if (present) describe_device(out, true);
    closed_ = true;
  } else if (code == import_request) {
    if (in_.size() < op_header + bus_id_size) return false;
    std::string wanted(bus_id_size, '\0');
    for (std::size_t i = 0; i < bus_id_size; ++i) wanted[i] = static_cast<char>(in_[op_header + i]);
    const bool found = port_.unit().on_bus() && wanted.substr(0, wanted.find('\0')) == bus_id;
    out.u16(version).u16(import_reply).u32(found ? 0 : 1);
    if (found) describe_device(out, false);
    imported_ = found;
    departures_ = port_.unit().departures();
    closed_ = !found;
    in_.erase(in_.begin(), in_.begin() + op_header + bus_id_size);
  } else {
    closed_ = true;
    return false;
  }
  send(out.take());
  return true;
}

bool Session::command() {
  if (in_.size() < header_size) return false;
  const Header header = parse_header(in_);
  if (header.command == usbip::unlink) {
    in_.erase(in_.begin(), in_.begin() + header_size);
    unlink(header);
    return true;
  }
  const bool sane = header.command == usbip::submit && header.direction <= direction_in &&
                    header.length <= most_bytes && header.endpoint <= 15 &&
                    under_way_.size() < most_transfers && !under_way_.contains(header.sequence);
  if (!sane) {
    closed_ = true;
    return false;
  }
  const std::size_t data = header.direction == direction_out ? header.length : 0;
  if (in_.size() < header_size + data) return false;
  submit(header, std::span(in_).subspan(header_size, data));
  in_.erase(in_.begin(), in_.begin() + static_cast<std::ptrdiff_t>(header_size + data));
  return true;
}

void Session::submit(const Header& h, std::span<const std::byte> data) {
  if (h.endpoint == 0) {
    const std::span setup(h.setup);
    const Request request{.type = std::to_integer<std::uint8_t>(setup[0]),
                          .number = std::to_integer<std::uint8_t>(setup[1]),
                          .value = get16(setup.subspan(2)),
                          .index = get16(setup.subspan(4)),
                          .length = get16(setup.subspan(6))};
    std::vector<std::byte> reply;
    const Outcome outcome = port_.control(request, data, reply);
    if (reply.size() > h.length) reply.resize(h.length);
    const bool in = h.direction == direction_in;
    const std::size_t moved = outcome != Outcome::ok ? 0 : in ? reply.size() : data.size();
    answer(h.sequence, status_of(outcome), moved, reply);
    return;
  }
  const bool in = h.direction == direction_in;
  const auto endpoint = static_cast<std::uint8_t>(h.endpoint | (in ? 0x80U : 0U));
  under_way_.insert(h.sequence);
  const bool good =
      in ? port_.submit_in(h.sequence, endpoint, h.length) : port_.submit_out(h.sequence, endpoint, data);
  if (good) return;
  under_way_.erase(h.sequence);
  answer(h.sequence, -ENOENT, 0, {});
}

void Session::unlink(const Header& h) {
  // Answers that are already on their way come before: then there is nothing to unlink.
  collect();
  const std::uint32_t victim = h.word;
  const bool found = under_way_.erase(victim) > 0;
  if (found) port_.cancel(victim);
  collect();
  Header reply{.command = unlink_reply, .sequence = h.sequence, .setup = {}};
  reply.word = static_cast<std::uint32_t>(found ? -ECONNRESET : 0);
  send(to_bytes(reply));
}

void Session::collect() {
  for (const Finished& f : port_.take_finished())
    // An unlinked transfer has no answer of its own.
    if (under_way_.erase(static_cast<std::uint32_t>(f.id)) > 0)
      answer(static_cast<std::uint32_t>(f.id), status_of(f.outcome), f.moved, f.data);
  // One that came back meanwhile is another device.
  if (imported_ && port_.unit().departures() != departures_) closed_ = true;
}

void Session::answer(std::uint32_t sequence, int status, std::size_t length,
                     std::span<const std::byte> data) {
  Header reply{.command = submit_reply, .sequence = sequence, .setup = {}};
  reply.word = static_cast<std::uint32_t>(status);
  reply.length = static_cast<std::uint32_t>(length);
  reply.packets = 0xFFFFFFFF;  // not isochronous
  send(to_bytes(reply));
  send(data);
}

}  // namespace ferrobench::emulator::usbip
