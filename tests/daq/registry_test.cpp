#include "daq/registry.h"

#include <gtest/gtest.h>

#include "daq/selftest.h"
#include "daq/virtual/virtual_device.h"

namespace ferrobench::daq {
namespace {

TEST(Registry, OpensTheVirtualDeviceWithItsDefaults) {
  const auto device = open_device("virtual", nullptr);
  EXPECT_EQ(device->info().at("clock"), "real");
  EXPECT_EQ(device->columns().size(), 4U);
}

TEST(Registry, EveryKindPublishesASchema) {
  for (const auto& kind : device_kinds()) EXPECT_EQ(kind.schema().at("type"), "object") << kind.name;
}

TEST(Registry, SaysWhatIsWrong) {
  try {
    open_device("virtuel", {});
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::not_found);
    EXPECT_NE(error.problems().at(0).hint.find("virtual"), std::string::npos);
  }
  try {
    open_device("virtual", {{"clock", "warp"}, {"force", {{"range", 0}}}, {"speed", 1}});
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::invalid_params);
    EXPECT_EQ(error.problems().size(), 3U);
  }
  EXPECT_THROW(open_device("virtual", {{"model", "unobtainium"}}), Error);
  EXPECT_THROW(open_device("virtual", {{"model", {{"format", "x"}}}}), Error);
  const nlohmann::json off{{"enabled", false}};
  EXPECT_THROW(
      open_device("virtual", {{"field", off}, {"charge", off}, {"displacement", off}, {"force", off}}),
      Error);
}

SelftestReport test(const VirtualConfig& config) {
  VirtualDevice device(model::Model{}, config);
  return selftest(device);
}

const SelftestRow& row(const SelftestReport& report, const std::string& quantity) {
  for (const auto& r : report.rows)
    if (r.quantity == quantity) return r;
  throw std::out_of_range(quantity);
}

TEST(Selftest, PassesOnAHealthyDevice) {
  VirtualConfig config;
  for (std::int64_t seed = 1; seed < 30; ++seed) {
    config.clock = seed == 1 ? Clock::real : Clock::fast;
    config.seed = seed;
    const auto report = test(config);
    EXPECT_TRUE(report.passed()) << to_json(report).dump(1);
    EXPECT_GE(report.rows.size(), 7U);
  }
}

TEST(Selftest, FindsAMonitorThatIsOff) {
  VirtualConfig config;
  config.clock = Clock::fast;
  config.field.offset = 500;
  config.field.gain = 1.05;
  const auto report = test(config);
  EXPECT_FALSE(report.passed());
  EXPECT_FALSE(row(report, "monitor offset").passed());
  EXPECT_NEAR(row(report, "monitor offset").measured, 500, 50);
  EXPECT_NEAR(row(report, "monitor gain").measured, 1.05, 0.01);
  EXPECT_FALSE(row(report, "monitor gain").passed());
}

TEST(Selftest, NeedsTheMonitor) {
  VirtualConfig config;
  config.field.enabled = false;
  EXPECT_THROW(test(config), Error);
}

}  // namespace
}  // namespace ferrobench::daq
