#include "daq/usb/pace_watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

namespace ferrobench::daq::usb {
namespace {

using testing::HasSubstr;

constexpr double rate = 1000;  // Hz

HostClock::TimePoint at(double seconds) {
  return HostClock::TimePoint(
      std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(seconds)));
}

// What is said of a pacer that is off by this share, over so many seconds of packets of 20 ticks, each with a
// delay of the host's.
template <class Delay>
std::string said(double error, double seconds, Delay delay) {
  PaceWatch watch(rate);
  watch.begin(at(0));
  std::uint64_t ticks = 0;
  double time = 0;
  while (time < seconds) {
    ticks += 20;
    time = static_cast<double>(ticks - 1) / (rate * (1 + error));
    if (auto wrong = watch.check(ticks, at(time + delay())); !wrong.empty()) return wrong;
  }
  return {};
}
double none() {
  return 0;
}

TEST(PaceWatch, SaysNothingOfAPacerAndAHostThatAreInTime) {
  EXPECT_EQ(said(0, 100, none), "");
  EXPECT_EQ(said(1e-4, 1000, none), "");
  EXPECT_EQ(said(-1e-4, 1000, none), "");
}

TEST(PaceWatch, ForgivesAHostThatIsOftenLate) {
  std::mt19937_64 random(3);
  // Up to 0.1 s late, in time once in ten packets.
  const auto delay = [&] { return random() % 10 == 0 ? 1e-4 : 1e-4 * static_cast<double>(random() % 1000); };
  EXPECT_EQ(said(0, 1000, delay), "");
}

TEST(PaceWatch, NoticesAPacerThatRunsFast) {
  EXPECT_THAT(said(1e-3, 10, none), HasSubstr("fast"));
  EXPECT_THAT(said(0.1, 0.2, none), HasSubstr("fast"));
}

TEST(PaceWatch, NoticesAPacerThatRunsSlow) {
  EXPECT_THAT(said(-1e-3, 200, none), HasSubstr("slow"));
  EXPECT_THAT(said(-0.1, 1.2, none), HasSubstr("slow"));
}

}  // namespace
}  // namespace ferrobench::daq::usb
