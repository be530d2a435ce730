#include "daq/usb/unit.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstdio>

#include "base/fields.h"
#include "daq/usb/little_endian.h"

namespace ferrobench::daq::usb {

namespace {

constexpr std::chrono::milliseconds patience{1000};
constexpr std::size_t longest_piece = 64;  // bytes of memory or image in one request

constexpr std::uint8_t to_device = 0x40;  // vendor, recipient device
constexpr std::uint8_t from_device = 0xC0;

namespace request {
constexpr std::uint8_t dio_direction = 0x00, dio_pins = 0x01, dio_latch = 0x02;
constexpr std::uint8_t input_value = 0x10, input_start = 0x12, input_stop = 0x13, input_queue = 0x14,
                       input_clear = 0x15;
constexpr std::uint8_t output_value = 0x18, output_start = 0x1A, output_stop = 0x1B, output_clear = 0x1C;
constexpr std::uint8_t memory = 0x30, memory_address = 0x31;
constexpr std::uint8_t status = 0x40, trigger = 0x43;
constexpr std::uint8_t fpga_enter = 0x50, fpga_data = 0x51;
}  // namespace request

std::string hex(unsigned value) {
  std::array<char, 16> text{};
  static_cast<void>(std::snprintf(text.data(), text.size(), "0x%02X", value));
  return text.data();
}

ErrorCode code_of(LinkStatus status) {
  return status == LinkStatus::stall ? ErrorCode::bad_state : ErrorCode::device_lost;
}

std::uint32_t pacer_word(std::uint64_t period) {
  assert(period <= std::uint64_t{1} << 32);
  return period == 0 ? 0 : static_cast<std::uint32_t>(period - 1);
}

}  // namespace

std::string_view link_status_name(LinkStatus status) {
  constexpr std::array<std::string_view, 7> names{"ok",       "stall",     "timeout", "no device",
                                                  "overflow", "cancelled", "error"};
  return names.at(static_cast<std::size_t>(status));
}

LinkFailure::LinkFailure(LinkStatus status, std::string message, std::string hint)
    : Error(code_of(status), std::move(message),
            Problem{.message = "the link says: " + std::string(link_status_name(status)),
                    .hint = !hint.empty()                     ? std::move(hint)
                            : status == LinkStatus::no_device ? "check the cable and plug the unit in again"
                            : status == LinkStatus::timeout
                                ? "unplug the unit, plug it in again and start again"
                                : "start again; if it stays so, unplug the unit and plug it in again"}),
      status_(status) {}

double full_scale(InputRange range) {
  constexpr std::array<double, range_count> volts{10, 5, 2, 1};
  return volts.at(static_cast<std::size_t>(range));
}

std::array<std::byte, longest_queue> pack_queue(std::span<const QueueElement> queue) {
  assert(!queue.empty() && queue.size() <= longest_queue);
  std::array<std::byte, longest_queue> out{};
  for (std::size_t i = 0; i < queue.size(); ++i) {
    const auto& e = queue[i];
    assert(e.channel >= 0 && e.channel < (e.mode == InputMode::differential ? 8 : 16));
    // The upper single-ended inputs are a mode of their own.
    const int mode = e.mode == InputMode::differential ? 0 : e.channel < 8 ? 1 : 2;
    const int last = i + 1 == queue.size() ? 1 : 0;
    out.at(i) =
        static_cast<std::byte>(e.channel % 8 | static_cast<int>(e.range) << 3 | mode << 5 | last << 7);
  }
  return out;
}

std::array<std::byte, 15> pack_input_scan(const InputScan& scan) {
  assert(scan.packet_samples >= 1 && scan.packet_samples <= 256);
  constexpr unsigned burst = 1, trigger = 1u << 3;
  std::array<std::byte, 15> out{};  // scan count 0: until stopped; no retrigger
  store_le(pacer_word(scan.period), std::span(out).subspan(8, 4));
  out[12] = static_cast<std::byte>(scan.packet_samples - 1);
  out[13] = static_cast<std::byte>(burst | (scan.triggered ? trigger : 0));
  return out;
}

std::array<std::byte, 13> pack_output_scan(const OutputScan& scan) {
  assert(scan.channel == 0 || scan.channel == 1);
  constexpr unsigned trigger = 1u << 4;
  std::array<std::byte, 13> out{};
  store_le(pacer_word(scan.period), std::span(out).subspan(8, 4));
  out[12] = static_cast<std::byte>(1u << scan.channel | (scan.triggered ? trigger : 0));
  return out;
}

Unit::Unit(std::unique_ptr<Link> link)
    : link_(std::move(link)), id_(link_->id()), model_(find_model(id_.vendor, id_.product)) {
  id_.serial = excerpt(id_.serial);
  if (model_ != nullptr && model_->driven) {
    find_endpoints();
    return;
  }
  throw Error(ErrorCode::device_unavailable,
              "this driver does not speak to " +
                  (model_ == nullptr ? "product " + hex(id_.product) : std::string(model_->name)),
              Problem{.path = "/serial_number",
                      .given = id_.serial,
                      .allowed = "USB-1608GX-2AO",
                      .hint = "choose another unit; device.list names those attached"});
}

void Unit::find_endpoints() {
  packet_bytes_ = link_->packet_bytes(input_endpoint);
  for (const auto endpoint : {input_endpoint, output_endpoint}) {
    if (endpoint == output_endpoint && model_->outputs == 0) continue;
    const auto bytes = link_->packet_bytes(endpoint);
    if (bytes == packet_bytes_ && (bytes == full_speed_packet || bytes == high_speed_packet)) continue;
    throw Error(ErrorCode::device_unavailable, "unit " + id_.serial + " has not the endpoints of its kind",
                Problem{.path = "/endpoints/" + hex(endpoint),
                        .message = "is no bulk endpoint with packets of its speed",
                        .given = bytes,
                        .allowed = {full_speed_packet, high_speed_packet},
                        .unit = "bytes",
                        .hint = "unplug the unit and plug it in again, without a hub"});
  }
}

// Bulk packets in a frame, by the USB specification: 19 in 1 ms, or 13 in 125 us.
double Unit::bus_rate() const {
  return static_cast<double>(packet_bytes_) * (high_speed() ? 13 * 8000 : 19 * 1000);
}

void Unit::write(std::uint8_t request, std::string_view what, std::span<const std::byte> data,
                 std::uint16_t value, std::uint16_t index, Retry retry) {
  const ControlRequest setup{to_device, request, value, index};
  auto status = link_->control_out(setup, data, patience);
  if (status != LinkStatus::ok && status != LinkStatus::no_device && retry == Retry::once)
    status = link_->control_out(setup, data, patience);
  if (status != LinkStatus::ok)
    throw LinkFailure(status,
                      "the unit did not take a request: " + std::string(what) + " (" + hex(request) + ")");
}

void Unit::read(std::uint8_t request, std::string_view what, std::span<std::byte> data, std::uint16_t value) {
  const ControlRequest setup{from_device, request, value, 0};
  std::size_t actual = 0;
  auto status = LinkStatus::ok;
  for (int attempt = 0; attempt < 2; ++attempt) {
    actual = 0;
    status = link_->control_in(setup, data, actual, patience);
    if (status == LinkStatus::no_device || (status == LinkStatus::ok && actual == data.size())) break;
  }
  if (status == LinkStatus::ok && actual == data.size()) return;
  const auto about = std::string(what) + " (" + hex(request) + ")";
  if (status != LinkStatus::ok) throw LinkFailure(status, "the unit did not answer a request: " + about);
  throw LinkFailure(LinkStatus::error, "the unit answered " + std::to_string(actual) + " bytes instead of " +
                                           std::to_string(data.size()) + ": " + about);
}

UnitStatus Unit::status() {
  std::array<std::byte, 2> word{};
  read(request::status, "status", word);
  return {load_le<std::uint16_t>(word)};
}

void Unit::read_memory(std::uint16_t address, std::span<std::byte> data) {
  // The address moves along with each read, so a piece that failed starts with its address again.
  for (std::size_t at = 0; at < data.size(); at += longest_piece) {
    const auto piece = data.subspan(at, std::min(longest_piece, data.size() - at));
    std::array<std::byte, 2> where{};
    store_le(static_cast<std::uint16_t>(address + at), std::span(where));
    const ControlRequest setup{from_device, request::memory, 0, 0};
    auto status = LinkStatus::ok;
    std::size_t actual = 0;
    for (int attempt = 0; attempt < 2; ++attempt) {
      write(request::memory_address, "memory address", where);
      actual = 0;
      status = link_->control_in(setup, piece, actual, patience);
      if (status == LinkStatus::no_device || (status == LinkStatus::ok && actual == piece.size())) break;
    }
    if (status == LinkStatus::ok && actual != piece.size()) status = LinkStatus::error;
    if (status != LinkStatus::ok)
      throw LinkFailure(status,
                        "the unit's memory cannot be read at " + hex(address + static_cast<unsigned>(at)));
  }
}

void Unit::load_fpga(std::span<const std::byte> image) {
  constexpr std::byte key{0xAD};
  write(request::fpga_enter, "enter FPGA configuration", std::span(&key, 1), 0, 0, Retry::no);
  for (std::size_t at = 0; at < image.size(); at += longest_piece)
    write(request::fpga_data, "FPGA image", image.subspan(at, std::min(longest_piece, image.size() - at)), 0,
          0, Retry::no);
}

void Unit::set_inputs(std::uint8_t mask) {
  write(request::dio_direction, "direction of the digital lines", {}, mask);
}

void Unit::set_latch(std::uint8_t levels) {
  write(request::dio_latch, "digital outputs", {}, levels);
}

std::uint8_t Unit::pins() {
  std::array<std::byte, 1> levels{};
  read(request::dio_pins, "digital inputs", levels);
  return static_cast<std::uint8_t>(levels[0]);
}

void Unit::trigger_on_rising_edge() {
  constexpr std::byte rising_edge{3};
  write(request::trigger, "trigger set-up", std::span(&rising_edge, 1));
}

void Unit::load_queue(std::span<const QueueElement> queue) {
  write(request::input_queue, "input queue", pack_queue(queue));
}

std::uint16_t Unit::convert(const QueueElement& element) {
  std::array<std::byte, 2> code{};
  read(request::input_value, "one conversion", code, static_cast<std::uint16_t>(element.channel));
  return load_le<std::uint16_t>(code);
}

void Unit::start_input(const InputScan& scan) {
  write(request::input_start, "start of the input scan", pack_input_scan(scan), 0, 0, Retry::no);
}

void Unit::stop_input() {
  write(request::input_stop, "stop of the input scan");
}

void Unit::clear_input() {
  write(request::input_clear, "clearing the input FIFO");
}

void Unit::start_output(const OutputScan& scan) {
  write(request::output_start, "start of the output scan", pack_output_scan(scan), 0, 0, Retry::no);
}

void Unit::stop_output() {
  write(request::output_stop, "stop of the output scan");
}

void Unit::clear_output() {
  write(request::output_clear, "clearing the output FIFO");
}

void Unit::clear_halts() {
  for (const auto endpoint : {input_endpoint, output_endpoint})
    if (const auto status = link_->clear_halt(endpoint); status != LinkStatus::ok)
      throw LinkFailure(status, "endpoint " + hex(endpoint) + " cannot be cleared");
}

void Unit::write_output(int channel, std::uint16_t code) {
  // NOLINTNEXTLINE(readability-suspicious-call-argument)
  write(request::output_value, "output value", {}, code, static_cast<std::uint16_t>(channel));
}

std::optional<std::uint16_t> Unit::read_output(int channel) {
  std::array<std::byte, 4> codes{};
  std::size_t actual = 0;
  const ControlRequest setup{from_device, request::output_value, 0, 0};
  if (link_->control_in(setup, codes, actual, patience) != LinkStatus::ok || actual != codes.size())
    return std::nullopt;
  return load_le<std::uint16_t>(std::span(codes).subspan(2 * static_cast<std::size_t>(channel), 2));
}

}  // namespace ferrobench::daq::usb
