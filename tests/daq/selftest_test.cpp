#include "daq/selftest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daq/replay/replay_device.h"
#include "daq/virtual/virtual_device.h"
#include "faulty_device.h"

namespace ferrobench::daq {
namespace {

using recordings::Channel;
using testing::AllOf;
using testing::HasSubstr;

VirtualConfig fast() {
  VirtualConfig config;
  config.clock = Clock::fast;
  return config;
}

SelftestReport test(const VirtualConfig& config, double rate = selftest_rate) {
  VirtualDevice device(model::Model{}, config);
  return selftest(device, rate);
}

std::string text_of(const SelftestReport& report) {
  return write_json(report).dump(1);
}

const SelftestRow& row(const SelftestReport& report, const std::string& quantity) {
  for (const auto& r : report.rows)
    if (r.quantity == quantity) return r;
  throw std::out_of_range(quantity);
}

// A virtual device as others would have it: its values in SI instead of counts, its pacer with steps.
class Other final : public Device {
 public:
  explicit Other(const VirtualConfig& config) : device_(model::Model{}, config) {}

  bool in_si = false;
  double clock = 0;  // Hz, that the pacer divides by whole numbers; 0: any rate

  nlohmann::json info() const override { return device_.info(); }
  std::vector<recordings::RawColumn> columns() const override {
    return in_si ? std::vector<recordings::RawColumn>{} : device_.columns();
  }
  std::vector<Channel> signals() const override {
    std::vector<Channel> out;
    if (in_si)
      for (const auto& column : device_.columns()) out.push_back(column.channel);
    return out;
  }
  std::array<std::optional<double>, 5> noise() const override { return device_.noise(); }
  OutputRange output_range() const override { return device_.output_range(); }
  double scan_rate(double asked) const override {
    return device_.scan_rate(clock > 0 ? clock / std::round(clock / asked) : asked);
  }
  double output() const override { return device_.output(); }
  void go_to(double level, double slew) override { device_.go_to(level, slew); }
  void start(double rate, LevelSource& source) override { device_.start(rate, source); }
  bool read(SampleBlock& block) override {
    if (!device_.read(block)) return false;
    if (!in_si) return true;
    const auto columns = device_.columns();
    for (std::size_t i = 0; i < block.counts.size(); ++i) {
      const auto& column = columns[i % columns.size()];
      block.signals.at(static_cast<std::size_t>(column.channel))
          .push_back(column.offset + column.gain * block.counts[i]);
    }
    block.counts.clear();
    return true;
  }

 private:
  VirtualDevice device_;
};

TEST(Selftest, PassesOnAHealthyDevice) {
  auto config = fast();
  for (std::int64_t seed = 1; seed < 30; ++seed) {
    config.clock = seed == 1 ? Clock::real : Clock::fast;
    config.seed = seed;
    const auto report = test(config);
    EXPECT_TRUE(report.passed) << text_of(report);
    EXPECT_GE(report.rows.size(), 7U);
  }
}

TEST(Selftest, PassesAtAnyRate) {
  for (const double rate : {0.5, 10.0, 333.3, 1000.0, 7919.0, 100e3}) {
    const auto report = test(fast(), rate);
    EXPECT_TRUE(report.passed) << rate << text_of(report);
    EXPECT_EQ(report.sample_rate, rate);
    EXPECT_GE(row(report, "rows").measured, 300);
  }
  EXPECT_THROW(test(fast(), 1e9), Error);
  EXPECT_THROW(test(fast(), 0), Error);
}

TEST(Selftest, PassesWhereThePacerHasSteps) {
  Other device(fast());
  device.clock = 64e3 / 7;
  const auto report = selftest(device);
  EXPECT_TRUE(report.passed) << text_of(report);
  EXPECT_NEAR(report.sample_rate, 1000, 20);
  EXPECT_NE(report.sample_rate, 1000);
}

TEST(Selftest, MeasuresADeviceThatGivesSiValues) {
  for (const double rate : {50.0, 1000.0, 10e3}) {
    Other counted(fast()), si(fast());
    si.in_si = true;
    const auto report = selftest(si, rate);
    EXPECT_TRUE(report.passed) << rate << text_of(report);
    for (const auto& r : selftest(counted, rate).rows)
      EXPECT_DOUBLE_EQ(row(report, r.quantity).measured, r.measured) << r.quantity;
  }
  auto config = fast();
  config.field.offset = 500;
  config.field.gain = 1.05;
  config.force.enabled = false;
  Other off(config);
  off.in_si = true;
  const auto report = selftest(off);
  EXPECT_FALSE(report.passed);
  EXPECT_FALSE(row(report, "monitor offset").passed);
  EXPECT_FALSE(row(report, "monitor gain").passed);
}

TEST(Selftest, FindsAMonitorThatIsOff) {
  auto config = fast();
  config.field.offset = 500;
  config.field.gain = 1.05;
  const auto report = test(config);
  EXPECT_FALSE(report.passed);
  EXPECT_FALSE(row(report, "monitor offset").passed);
  EXPECT_NEAR(row(report, "monitor offset").measured, 500, 50);
  EXPECT_NEAR(row(report, "monitor gain").measured, 1.05, 0.01);
  EXPECT_FALSE(row(report, "monitor gain").passed);
}

std::string failure_of(Device& device, const std::function<std::string()>& stop_wanted = {}) {
  try {
    selftest(device, selftest_rate, stop_wanted);
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

TEST(Selftest, NeedsTheMonitor) {
  auto config = fast();
  config.field.enabled = false;
  for (const bool in_si : {false, true}) {
    Other device(config);
    device.in_si = in_si;
    EXPECT_THAT(failure_of(device), HasSubstr("field channel"));
  }
}

TEST(Selftest, AReplayHasNothingToTest) {
  recordings::Recording recording;
  recording.time = {0, 1, 2};
  for (const auto channel : {Channel::command, Channel::field}) recording.set(channel) = {0, 1e4, 0};
  ReplayDevice device(recording, {.clock = Clock::fast});
  EXPECT_THAT(failure_of(device), AllOf(HasSubstr("replay"), HasSubstr("recorded")));
}

TEST(Selftest, SaysThatTheOutputMayNotBeAtZero) {
  const auto words = HasSubstr("the output may not be at zero, switch the amplifier off: no answer");
  FaultyDevice lost{Limits{}};
  lost.fault = Fault::lost;
  lost.fault_at = 10;  // on the way up
  int blocks = 0;
  const auto deafen = [&](FaultyDevice& device, int at) {
    return [&device, &blocks, at] {
      if (++blocks == at) device.deaf = 1000;
      return std::string{};
    };
  };
  EXPECT_THAT(failure_of(lost, deafen(lost, 9)), AllOf(HasSubstr("did not come to its end"), words));

  FaultyDevice deaf{Limits{}};
  deaf.watched.put(1e5, 1);  // where somebody left it
  deaf.deaf = 1000;
  EXPECT_THAT(failure_of(deaf), words);
}

}  // namespace
}  // namespace ferrobench::daq
