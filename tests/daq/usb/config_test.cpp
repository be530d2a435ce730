#include "daq/usb/config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/daq/programs.h"
#include "tests/daq/usb/bench.h"

namespace ferrobench::daq::usb {
namespace {

using nlohmann::json;

std::vector<std::string> complaints(const json& config) {
  std::vector<std::string> out;
  try {
    usb_config_from_json(config);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::invalid_params);
    for (const auto& p : error.problems()) out.push_back(p.path);
  }
  return out;
}

json with(const std::string& pointer, const json& value) {
  auto out = bench_json();
  out[json::json_pointer(pointer)] = value;
  return out;
}

TEST(UsbConfig, TakesTheBenchAndWritesItBack) {
  const auto config = usb_config_from_json(bench_json());
  EXPECT_DOUBLE_EQ(config.amplifier.stop_slew, 200);
  EXPECT_TRUE(complaints(write_json(config)).empty());
  EXPECT_TRUE(json_schema<UsbConfig>().at("properties").contains("amplifier"));
}

TEST(UsbConfig, SaysEverythingThatIsWrong) {
  using testing::ElementsAre;
  EXPECT_THAT(complaints(json::object()), ElementsAre("/amplifier", "/specimen", "/field"));
  EXPECT_THAT(complaints(with("/field/channel", 1)), ElementsAre("/charge/channel"));
  EXPECT_THAT(complaints(with("/charge/channel", 9)), ElementsAre("/charge/channel"));
  EXPECT_THAT(complaints(with("/charge/range", 3)), ElementsAre("/charge/range"));
  EXPECT_THAT(complaints(with("/charge/capacitance", 1e-6)), ElementsAre("/charge"));
  EXPECT_THAT(complaints(with("/specimen/max_charge", 2e-4)), ElementsAre("/charge/range"));
  EXPECT_THAT(complaints(with("/displacement/sensitivity", 0)), ElementsAre("/displacement/sensitivity"));
  EXPECT_THAT(complaints(with("/marker/level", 0.05)), ElementsAre("/marker/level"));
  EXPECT_THAT(complaints(with("/marker/level", 9.95)), ElementsAre("/marker/level"));
  EXPECT_THAT(complaints(with("/field/range", 5)), ElementsAre("/field/range"));
  EXPECT_THAT(complaints(with("/amplifier/enable_bit", 0)), ElementsAre("/amplifier/enable_bit"));
  EXPECT_THAT(complaints(with("/amplifier/gian", 0)), ElementsAre("/amplifier/gian"));
  auto blind = bench_json();
  blind.erase("marker");
  blind.erase("monitor_check");
  EXPECT_THAT(complaints(blind), ElementsAre("/marker"));
  auto bent = bench_json();
  bent["displacement"] = {
      {"channel", 2},
      {"table",
       {{{"volts", 0}, {"value", 0}}, {{"volts", 1}, {"value", 1}}, {{"volts", 1}, {"value", 0.5}}}}};
  EXPECT_THAT(complaints(bent), ElementsAre("/displacement/table/2/volts", "/displacement/table/2/value"));
}

TEST(UsbConfig, AFileNamesItsImageBesideItself) {
  const auto path = testing::TempDir() + "/bench.json";
  auto config = bench_json();
  config["fpga_image"] = "images/unit.rbf";
  std::ofstream(path) << config.dump();
  const auto folder = std::filesystem::path(testing::TempDir()).lexically_normal();
  EXPECT_EQ(std::filesystem::path(load(path).fpga_image), (folder / "images/unit.rbf").lexically_normal());
  EXPECT_THROW(load(testing::TempDir() + "/nothing.json"), Error);
  std::ofstream(path) << "{";
  EXPECT_THROW(load(path), Error);
}

TEST(Amplifier, ListsWhateverDoesNotFit) {
  const auto config = usb_config_from_json(bench_json());
  const Amplifier amplifier(config.amplifier, config.specimen);
  const auto check = [&](const protocols::SampledWaveform& program) {
    std::vector<std::string> out;
    for (const auto& p : check_amplifier(program, config.amplifier, config.specimen, amplifier.range()))
      out.push_back(p.path + " " + p.unit);
    return out;
  };
  // 1e6 V/m in 10 ms: 1e4 V/s, 10 mA.
  EXPECT_TRUE(check(program({line(0, 1e6, 0.01), line(1e6, 0, 0.01)}, 10000)).empty());
  EXPECT_THAT(check(program({line(0, 2.1e6, 0.1), line(2.1e6, 0, 0.1)}, 1000)),
              testing::ElementsAre("/segments/0/level V", "/segments/1/level V"));
  // 1e6 V/m in 0.5 ms: 2e5 V/s, which the amplifier just does, and 0.2 A, which it does not.
  EXPECT_THAT(check(program({line(0, 1e6, 0.0005), line(1e6, 1e6, 1)}, 20000)),
              testing::ElementsAre("/segments/0/rate A"));
  EXPECT_THAT(check(program({sine(0, 1e6, 400, 0.1)}, 20000)),
              testing::ElementsAre("/segments/0/rate V/s", "/segments/0/rate A"));
}

TEST(Amplifier, PolarityTurnsTheOutputNotTheField) {
  auto inverted = bench_json();
  inverted["amplifier"]["polarity"] = "inverted";
  inverted["amplifier"]["voltage_min"] = -50;
  const auto config = usb_config_from_json(inverted);
  const Amplifier amplifier(config.amplifier, config.specimen);
  EXPECT_DOUBLE_EQ(amplifier.output_volts(1e6), -5);
  EXPECT_DOUBLE_EQ(amplifier.field(-5), 1e6);
  EXPECT_DOUBLE_EQ(amplifier.range().min, -5e5);
  EXPECT_DOUBLE_EQ(amplifier.range().max, 2e6);
}

}  // namespace
}  // namespace ferrobench::daq::usb
