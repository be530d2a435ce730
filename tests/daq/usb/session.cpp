#include "tests/daq/usb/session.h"

#include <iostream>
#include <stdexcept>

#include "tests/daq/usb/byte_link.h"

namespace ferrobench::daq::usb {

namespace {

// The driver says on standard error where it could not reach zero, which here is nearly always.
class Quiet {
 public:
  Quiet() : before_(std::cerr.rdbuf(nullptr)) {}
  ~Quiet() { std::cerr.rdbuf(before_); }
  Quiet(const Quiet&) = delete;
  Quiet& operator=(const Quiet&) = delete;

 private:
  std::streambuf* before_;
};

void demand(bool kept, const char* promise) {
  if (!kept) throw std::logic_error(promise);
}

std::size_t stream(UsbDevice& device) {
  Pieces source({{.samples = 50, .level = 1e4}, {.samples = 50, .level = 0}});
  device.start(device.scan_rate(1000), source);
  std::uint64_t next = 0;
  SampleBlock block;
  while (device.read(block)) {
    demand(block.counts.size() == block.rows * device.columns().size(), "a block has whole rows");
    if (block.rows == 0) continue;
    demand(block.first_sample == next, "rows come in order, each once");
    next += block.rows;
  }
  demand(next <= 101, "no more rows come than were asked for");
  return next;
}

}  // namespace

std::size_t run_session(std::span<const std::byte> answers) {
  static const UsbConfig config = usb_config_from_json(bench_json());
  const Quiet quiet;
  FakeClock clock;
  std::size_t rows = 0;
  try {
    UsbDevice device(
        config, [&] { return std::make_unique<ByteLink>(answers, clock); }, clock);
    for (int run = 0; run < 2; ++run) {
      rows += stream(device);
      device.go_to(0, 1e6);
    }
  } catch (const Error&) {  // what a unit like this deserves
  }
  return rows;
}

}  // namespace ferrobench::daq::usb
