// What the driver asks of the memory once a stream is armed: nothing, in its own thread and in the one that
// reads. What the emulated unit takes behind link and clock is not counted, nor what libusb takes in their
// place: it asks for a record of each transfer that it submits.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "rig.h"
#include "tests/base/counted_memory.h"

namespace ferrobench::emulator {
namespace {

using counted::Pardon;
using daq::usb::LinkStatus;
using Milliseconds = std::chrono::milliseconds;

class PardonedLink final : public daq::usb::Link {
 public:
  explicit PardonedLink(Port& port) : link_(port, Pace::fast) {}
  daq::usb::DeviceId id() const override { return link_.id(); }
  std::size_t packet_bytes(std::uint8_t endpoint) const override { return link_.packet_bytes(endpoint); }
  LinkStatus control_out(const daq::usb::ControlRequest& request, std::span<const std::byte> data,
                         Milliseconds timeout) override {
    const Pardon pardon;
    return link_.control_out(request, data, timeout);
  }
  LinkStatus control_in(const daq::usb::ControlRequest& request, std::span<std::byte> data,
                        std::size_t& actual, Milliseconds timeout) override {
    const Pardon pardon;
    return link_.control_in(request, data, actual, timeout);
  }
  LinkStatus clear_halt(std::uint8_t endpoint) override { return link_.clear_halt(endpoint); }
  LinkStatus submit_in(std::uint8_t endpoint, std::span<std::byte> buffer, std::uint64_t token) override {
    const Pardon pardon;
    return link_.submit_in(endpoint, buffer, token);
  }
  LinkStatus submit_out(std::uint8_t endpoint, std::span<const std::byte> buffer,
                        std::uint64_t token) override {
    const Pardon pardon;
    return link_.submit_out(endpoint, buffer, token);
  }
  void cancel_all() override { link_.cancel_all(); }
  void wait(Milliseconds timeout, std::vector<daq::usb::Completion>& out) override {
    came_.clear();
    {
      const Pardon pardon;
      link_.wait(timeout, came_);
    }
    out.insert(out.end(), came_.begin(), came_.end());  // into memory of the driver
  }

 private:
  ProcessLink link_;
  std::vector<daq::usb::Completion> came_;
};

class PardonedClock final : public daq::usb::HostClock {
 public:
  explicit PardonedClock(Port& port) : clock_(port) {}
  TimePoint now() const override { return clock_.now(); }
  void sleep_for(std::chrono::nanoseconds time) override {
    const Pardon pardon;
    clock_.sleep_for(time);
  }

 private:
  DeviceClock clock_;
};

// A triangle of 1 kV/mm, a level for each row. The unit's time is faster than the clock: the reader is waited
// for, which on a unit is never so far behind. At 20,000 rows it may be by 43 blocks; 32 are made before.
class Triangle final : public daq::LevelSource {
 public:
  explicit Triangle(std::uint64_t rows) : rows_(rows) {}
  std::atomic<std::uint64_t> read = 0;  // rows

  daq::LinearPiece next(std::uint64_t /*wanted*/) override {
    counted::watched = true;  // in the thread of the driver
    while (given_ > read + 10'000) std::this_thread::yield();
    if (given_ == rows_) return {};
    const auto place = ++given_ % 20'000;
    return {.samples = 1, .level = 100.0 * static_cast<double>(std::min(place, 20'000 - place))};
  }

 private:
  std::uint64_t rows_, given_ = 0;
};

TEST(DriverMemory, AnArmedStreamAsksForNone) {
  ProofBoard board;
  Unit unit(jumpered(), board);
  Port port(unit);
  PardonedClock clock(port);
  constexpr std::uint64_t rows = 100'000;  // 2 s
  Triangle source(rows);
  daq::usb::UsbDevice device(
      daq::usb::usb_config_from_json(proof_config()), [&] { return std::make_unique<PardonedLink>(port); },
      clock, blank_image);
  device.go_to(0, 1e6);
  device.start(50e3, source);
  daq::SampleBlock block;
  block.counts.reserve(10'000 * device.columns().size());
  counted::watched = true;
  counted::asked = 0;
  counted::counting = true;
  while (source.read < rows * 9 / 10 && device.read(block)) {  // the end may ask for some
    ASSERT_EQ(block.status, daq::BlockStatus::ok) << block.message;
    source.read = block.first_sample + block.rows;
  }
  counted::counting = false;
  counted::watched = false;
  EXPECT_GE(source.read, rows * 9 / 10);
  EXPECT_EQ(counted::asked, 0) << "the first time for " << counted::asked_first << " bytes";
}

}  // namespace
}  // namespace ferrobench::emulator
