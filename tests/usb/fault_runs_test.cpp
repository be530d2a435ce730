// A few seeded runs of every fault, from both kinds of start; ferrobench_usb_fault_runs does many.
#include <gtest/gtest.h>

#include "fault_bench.h"

namespace ferrobench::emulator {
namespace {

using daq::usb::StartMode;

class FaultRuns : public testing::TestWithParam<int> {};

TEST_P(FaultRuns, AreNoticedAndLeaveADeviceThatWorks) {
  const auto kind = static_cast<FaultKind>(GetParam());
  for (const auto mode : {StartMode::trigger, StartMode::clock}) {
    FaultBench bench(mode);
    for (std::uint64_t seed = 0; seed < 3; ++seed) {
      const auto faulty = bench.faulty(kind, seed);
      EXPECT_EQ(faulty.crime, "") << seed << ": " << faulty.said;
      const auto sound = bench.sound(seed + 1);
      EXPECT_EQ(sound.crime, "") << seed << " after: " << faulty.said;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, FaultRuns, testing::Range(0, fault_kinds), [](const auto& p) {
  return std::string(fault_name(static_cast<FaultKind>(p.param)));
});

}  // namespace
}  // namespace ferrobench::emulator
