// A plain libusb program that drives the unit as the protocol note orders it, run inside the emulator: finds
// it, loads the FPGA, reads the calibration, plays a ramp looped back on a common trigger, cancels, is
// unplugged and plugged again. Ends with 0, or says what is wrong.
#include <libusb.h>

#include <array>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <source_location>
#include <utility>
#include <vector>

namespace {

using Buffer = std::vector<unsigned char>;
constexpr unsigned char in_endpoint = 0x86, out_endpoint = 0x02;
constexpr std::size_t image_bytes = 73722;  // product 0x0136
constexpr unsigned patience = 1000;         // ms

void expect(bool good, const char* what, std::source_location where = std::source_location::current()) {
  if (good) return;
  std::fprintf(stderr, "line %u: %s\n", where.line(), what);
  std::exit(1);
}

double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

libusb_device_handle* device = nullptr;

int write(std::uint8_t request, std::uint16_t value = 0, std::uint16_t index = 0, Buffer data = {}) {
  return libusb_control_transfer(device, 0x40, request, value, index, data.data(),
                                 static_cast<std::uint16_t>(data.size()), patience);
}

Buffer read(std::uint8_t request, std::size_t length) {
  Buffer data(length);
  const int got = libusb_control_transfer(device, 0xC0, request, 0, 0, data.data(),
                                          static_cast<std::uint16_t>(length), patience);
  data.resize(static_cast<std::size_t>(std::max(0, got)));
  return data;
}

unsigned word(const Buffer& b, std::size_t at = 0,
              std::source_location where = std::source_location::current()) {
  expect(b.size() > at + 1, "an answer is too short", where);
  return b.at(at) | unsigned{b.at(at + 1)} << 8;
}

void append(Buffer& b, std::uint32_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) b.push_back(static_cast<unsigned char>(value >> 8 * i));
}

float real(const Buffer& b, std::size_t at) {
  float f = 0;
  std::memcpy(&f, &b.at(at), sizeof f);
  return f;
}

// A transfer of ours that knows when it is over.
struct Transfer {
  libusb_transfer* transfer = libusb_alloc_transfer(0);
  Buffer buffer;
  bool over = false;

  Transfer() = default;
  Transfer(const Transfer&) = delete;
  Transfer& operator=(const Transfer&) = delete;
  ~Transfer() { libusb_free_transfer(transfer); }
  int submit(unsigned char endpoint, Buffer data) {
    buffer = std::move(data);
    over = false;
    libusb_fill_bulk_transfer(
        transfer, device, endpoint, buffer.data(), static_cast<int>(buffer.size()),
        [](libusb_transfer* t) { static_cast<Transfer*>(t->user_data)->over = true; }, this, 0);
    return libusb_submit_transfer(transfer);
  }
  // True: over within `seconds`.
  bool wait(double seconds) {
    const auto begin = std::chrono::steady_clock::now();
    while (!over && seconds_since(begin) < seconds) {
      timeval slice{0, 20'000};
      libusb_handle_events_timeout(nullptr, &slice);
    }
    return over;
  }
};

void open_unit() {
  device = libusb_open_device_with_vid_pid(nullptr, 0x09DB, 0x0136);
  expect(device != nullptr, "the unit is not found");
  expect(libusb_claim_interface(device, 0) == 0, "the interface cannot be claimed");
  libusb_device_descriptor d{};
  libusb_get_device_descriptor(libusb_get_device(device), &d);
  std::array<unsigned char, 64> serial{};
  const int length = libusb_get_string_descriptor_ascii(device, d.iSerialNumber, serial.data(),
                                                        static_cast<int>(serial.size()));
  expect(length == 8 && std::memcmp(serial.data(), "01A2B3C4", 8) == 0, "serial number");
  expect(libusb_get_max_packet_size(libusb_get_device(device), in_endpoint) == 512, "packet size");
}

void load_fpga() {
  expect(word(read(0x40, 2)) == 0, "the FPGA is not empty");
  expect(write(0x43, 0, 0, {3}) == LIBUSB_ERROR_PIPE, "a request works without FPGA");
  expect(write(0x50, 0, 0, {0xAD}) == 1, "configuration mode");
  for (std::size_t sent = 0; sent < image_bytes; sent += 64) {
    const std::size_t n = std::min<std::size_t>(64, image_bytes - sent);
    expect(write(0x51, 0, 0, Buffer(n)) == static_cast<int>(n), "a piece of the FPGA image");
  }
  expect(word(read(0x40, 2)) == 0x100, "the FPGA is not configured");
}

void loop_back() {
  write(0x31, 0, 0, {0x00, 0x70});
  const Buffer inputs = read(0x30, 32);
  write(0x31, 0, 0, {0x80, 0x70});
  const Buffer outputs = read(0x30, 16);
  expect(inputs.size() == 32 && outputs.size() == 16, "calibration");

  constexpr std::size_t scans = 30'000;
  const auto volts = [](std::size_t i) { return 9.0 * std::sin(static_cast<double>(i) * 1e-3); };
  Buffer waveform;
  for (std::size_t i = 0; i < scans; ++i)
    append(waveform,
           static_cast<std::uint32_t>(real(outputs, 0) * (volts(i) / 10 * 32768 + 32768) + real(outputs, 4) +
                                      0.5),
           2);

  write(0x02, 0);
  write(0x00, 0xFE);  // DIO0 drives TRIG
  expect(write(0x43, 0, 0, {3}) == 1, "trigger register");
  Buffer queue(16);
  queue[0] = 0x80 | 1 << 5;  // single-ended 0, +-10 V
  expect(write(0x14, 0, 0, queue) == 16, "queue");
  expect(libusb_clear_halt(device, in_endpoint) == 0 && libusb_clear_halt(device, out_endpoint) == 0,
         "clear halt");
  write(0x15);
  write(0x1C);

  std::deque<Transfer> in, out;
  for (std::size_t at = 0; at < waveform.size(); at += 8192) {
    const auto begin = waveform.begin() + static_cast<std::ptrdiff_t>(at);
    const auto n = std::min<std::size_t>(8192, waveform.size() - at);
    expect(
        out.emplace_back().submit(out_endpoint, Buffer(begin, begin + static_cast<std::ptrdiff_t>(n))) == 0,
        "output transfer");
  }
  for (std::size_t at = 0; at <= waveform.size(); at += 8192)
    expect(in.emplace_back().submit(in_endpoint, Buffer(8192)) == 0, "input transfer");
  constexpr std::uint32_t period = 639;  // 100 kS/s
  Buffer start_out, start_in;
  for (const std::uint32_t v : {std::uint32_t{scans}, 0U, period}) append(start_out, v, 4);
  start_out.push_back(1 | 1 << 4);
  for (const std::uint32_t v : {std::uint32_t{scans}, 0U, period}) append(start_in, v, 4);
  start_in.push_back(255);
  start_in.push_back(1 << 3);
  expect(write(0x1A, 0, 0, start_out) == 13 && write(0x12, 0, 0, start_in) == 14, "START");
  expect((word(read(0x40, 2)) & 0xA) == 0xA, "both wait for the trigger");
  expect(!in.front().over, "data before the trigger");
  write(0x02, 1);

  Buffer data;
  for (Transfer& t : in) {
    expect(t.wait(20), "the input scan does not end");
    expect(t.transfer->status == LIBUSB_TRANSFER_COMPLETED, "an input transfer fails");
    data.insert(data.end(), t.buffer.begin(), t.buffer.begin() + t.transfer->actual_length);
    if (t.transfer->actual_length < 8192) break;
  }
  expect(data.size() == 2 * scans, "number of samples");
  for (Transfer& t : out) expect(t.wait(5) && t.transfer->status == LIBUSB_TRANSFER_COMPLETED, "output");
  const unsigned status = word(read(0x40, 2));
  expect((status & 0x14) == 0 && (status & 0x40) != 0, "overrun, underrun or not done");
  for (std::size_t i = 1; i < scans; ++i) {
    const double corrected = word(data, 2 * i) * real(inputs, 0) + real(inputs, 4);
    const double measured = (corrected - 32768) * 10 / 32768;
    if (std::abs(measured - volts(i - 1)) < 1e-3) continue;  // three counts
    std::fprintf(stderr, "sample %zu: %g V for %g V\n", i, measured, volts(i - 1));
    std::exit(1);
  }
  write(0x13);
  write(0x02, 0);
}

void stream(Transfer& transfer, bool unplug) {
  // A scan that nobody triggers: the transfers stay under way.
  std::deque<Transfer> more;
  expect(transfer.submit(in_endpoint, Buffer(8192)) == 0, "input transfer");
  for (int i = 0; i < 15; ++i)
    expect(more.emplace_back().submit(in_endpoint, Buffer(8192)) == 0, "input transfer");
  if (unplug)
    kill(std::atoi(std::getenv("FERROBENCH_USB_EMULATOR")), SIGUSR1);
  else
    for (Transfer& t : more) libusb_cancel_transfer(t.transfer);
  if (!unplug) libusb_cancel_transfer(transfer.transfer);
  const auto expected = unplug ? LIBUSB_TRANSFER_NO_DEVICE : LIBUSB_TRANSFER_CANCELLED;
  expect(transfer.wait(10) && transfer.transfer->status == expected, "how a transfer ends");
  for (Transfer& t : more) expect(t.wait(10) && t.transfer->status == expected, "how the transfers end");
}

void cancel_and_unplug() {
  Transfer transfer;
  expect(transfer.submit(in_endpoint, Buffer(512)) == 0 && !transfer.wait(0.3), "data out of nowhere");
  libusb_cancel_transfer(transfer.transfer);
  expect(transfer.wait(5) && transfer.transfer->status == LIBUSB_TRANSFER_CANCELLED, "cancelling");
  stream(transfer, false);
  stream(transfer, true);
}

// A unit that came back is another device: whoever still has the one of before open is told that it is gone.
void through_the_handle_of_before(libusb_device_handle* before) {
  auto* now = std::exchange(device, before);
  expect(write(0x13) == LIBUSB_ERROR_NO_DEVICE, "the handle of before answers");
  expect(read(0x40, 2).empty(), "the handle of before reads");
  expect(libusb_clear_halt(device, in_endpoint) == LIBUSB_ERROR_NO_DEVICE, "it clears a halt");
  Transfer transfer;
  expect(transfer.submit(in_endpoint, Buffer(512)) == LIBUSB_ERROR_NO_DEVICE, "it takes a transfer");
  libusb_close(before);
  device = now;
  expect(word(read(0x40, 2)) == 0, "the unit of now does not mind");
}

// Null if it does not come back.
void reopen() {
  const auto begin = std::chrono::steady_clock::now();
  do {
    timeval slice{0, 20'000};
    libusb_handle_events_timeout(nullptr, &slice);
    device = libusb_open_device_with_vid_pid(nullptr, 0x09DB, 0x0136);
  } while (device == nullptr && seconds_since(begin) < 10);
}

}  // namespace

int main() {
  expect(libusb_init(nullptr) == 0, "libusb");
  open_unit();
  load_fpga();
  loop_back();
  cancel_and_unplug();
  expect(write(0x13) == LIBUSB_ERROR_NO_DEVICE, "an unplugged unit answers");

  auto* before = device;
  kill(std::atoi(std::getenv("FERROBENCH_USB_EMULATOR")), SIGUSR2);
  reopen();
  expect(device != nullptr && word(read(0x40, 2)) == 0, "back on the bus, without its FPGA image");
  through_the_handle_of_before(before);
  write(0x42);
  expect(write(0x13) == LIBUSB_ERROR_NO_DEVICE, "a unit answers while it resets");
  libusb_close(device);
  reopen();
  expect(device != nullptr && word(read(0x40, 2)) == 0, "back from its reset");
  libusb_close(device);
  libusb_exit(nullptr);
  std::puts("the unit did all that was asked of it");
}
