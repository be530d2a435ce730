// The in-process link keeps the driver's contract with its transport.
#include "host/process_link.h"

#include <gtest/gtest.h>

#include "client.h"

namespace ferrobench::emulator {
namespace {

using daq::usb::Completion;
using daq::usb::LinkStatus;
using std::chrono::milliseconds;

class ProcessLinkTest : public testing::TestWithParam<Pace> {
 protected:
  LinkStatus write(unsigned number, std::uint16_t value = 0, const Bytes& data = {}) {
    return link.control_out({.request_type = vendor_out,
                             .request = static_cast<std::uint8_t>(number),
                             .value = value,
                             .index = 0},
                            data, milliseconds(1000));
  }
  std::vector<Completion> wait_for(std::size_t count) {
    std::vector<Completion> out;
    for (int i = 0; i < 50 && out.size() < count; ++i) link.wait(milliseconds(100), out);
    return out;
  }

  PatternBoard board;
  Client client{Client::perfect(), &board};
  ProcessLink link{client.port, GetParam()};
};

TEST_P(ProcessLinkTest, BringsDataInTheOrderOfTheTransfers) {
  EXPECT_EQ(link.id().vendor, vendor_id);
  EXPECT_EQ(link.id().serial, "01A2B3C4");
  EXPECT_EQ(write(request::queue, 0, queue_of({0})), LinkStatus::ok);
  std::array<Bytes, 3> buffers;
  for (std::uint64_t i = 0; i < 3; ++i) {
    buffers.at(i).resize(1024);
    EXPECT_EQ(link.submit_in(input_endpoint, buffers.at(i), 100 + i), LinkStatus::ok);
  }
  EXPECT_EQ(write(request::input_start, 0, input_order({.scans = 1500, .period = 6399})), LinkStatus::ok);
  const auto done = wait_for(3);
  ASSERT_EQ(done.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(done[i].token, 100 + i);
    EXPECT_EQ(done[i].status, LinkStatus::ok);
    EXPECT_EQ(done[i].actual, i < 2 ? 1024U : 952U);
    for (std::size_t k = 0; k < done[i].actual / 2; ++k)
      ASSERT_EQ(get16(std::span(buffers.at(i)).subspan(2 * k)), PatternBoard::code(512 * i + k));
  }
}

TEST_P(ProcessLinkTest, WaitsNoLongerThanAsked) {
  std::vector<Completion> out;
  const Ticks before = client.port.now();
  link.wait(milliseconds(20), out);
  EXPECT_TRUE(out.empty());
  EXPECT_GE(client.port.now() - before, ticks_per_second / 1000 * 19);
}

TEST_P(ProcessLinkTest, CancelledTransfersComeBack) {
  Bytes in(512);
  const Bytes out(512);
  link.submit_in(input_endpoint, in, 1);
  for (std::uint64_t i = 2; i < 20; ++i)
    link.submit_out(output_endpoint, out, i);  // more than the FIFO holds
  link.cancel_all();
  const auto done = wait_for(19);
  ASSERT_EQ(done.size(), 19U);
  EXPECT_EQ(std::count_if(done.begin(), done.end(),
                          [](const Completion& c) { return c.status == LinkStatus::cancelled; }),
            1 + 18 - 8);
}

TEST_P(ProcessLinkTest, AGoneUnitIsSaidEverywhere) {
  Bytes in(512);
  link.submit_in(input_endpoint, in, 1);
  client.unit.unplug();
  const auto done = wait_for(1);
  ASSERT_EQ(done.size(), 1U);
  EXPECT_EQ(done[0].status, LinkStatus::no_device);
  EXPECT_EQ(write(request::input_stop), LinkStatus::no_device);
  EXPECT_EQ(link.submit_in(input_endpoint, in, 2), LinkStatus::no_device);
  EXPECT_EQ(link.clear_halt(input_endpoint), LinkStatus::no_device);
}

TEST_P(ProcessLinkTest, StallsAndShortAnswersAreTold) {
  EXPECT_EQ(write(0x77), LinkStatus::stall);
  Bytes answer(8);
  std::size_t actual = 99;
  EXPECT_EQ(link.control_in({.request_type = vendor_in, .request = request::status, .value = 0, .index = 0},
                            answer, actual, milliseconds(1000)),
            LinkStatus::ok);
  EXPECT_EQ(actual, 2U);
  EXPECT_EQ(get16(answer), status_bit::fpga_configured);
  EXPECT_EQ(link.submit_in(0x81, answer, 1), LinkStatus::error) << "no such endpoint";
}

INSTANTIATE_TEST_SUITE_P(Paces, ProcessLinkTest, testing::Values(Pace::fast, Pace::real),
                         [](const auto& p) { return p.param == Pace::fast ? "fast" : "real"; });

}  // namespace
}  // namespace ferrobench::emulator
