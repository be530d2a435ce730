#include "daq/registry.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace ferrobench::daq
