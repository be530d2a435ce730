#include "protocols/protocol.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "base/load_range.h"
#include "tests/protocols/programs.h"

namespace ferrobench::protocols {
namespace {

using nlohmann::json;
using testing::ElementsAre;

json with_parameters() {
  auto given = program({{{"kind", "ramp"}, {"to", "$top"}, {"rate", "$rate"}},
                        {{"kind", "ramp"}, {"to", "-$top"}, {"time", 1}}});
  given["parameters"] = {{"rate", 0.5}, {"top", 1.5}};
  return given;
}

TEST(Protocol, KeepsItsJson) {
  const auto given = with_parameters();
  const auto protocol = Protocol::from_json(given);
  EXPECT_EQ(protocol.json(), given);
  EXPECT_EQ(Protocol::from_text(protocol.json().dump()).json(), given);
  EXPECT_EQ(protocol.name(), "test");
  EXPECT_EQ(protocol.title(), "test");
}

TEST(Protocol, PutsParametersInPlace) {
  const auto protocol = Protocol::from_json(with_parameters());
  EXPECT_EQ(protocol.parameters(), (std::map<std::string, double>{{"rate", 0.5}, {"top", 1.5}}));
  EXPECT_THAT(durations(protocol.expand()), ElementsAre(3, 1));
  EXPECT_THAT(corner_levels(protocol.expand()), ElementsAre(0, 1.5, -1.5));
  EXPECT_THAT(durations(protocol.expand({.parameters = {{"rate", 3}}})), ElementsAre(0.5, 1));
}

TEST(Protocol, AsExecutedExpandsByItself) {
  const auto executed = Protocol::from_json(with_parameters()).with({.parameters = {{"rate", 3}}});
  EXPECT_EQ(executed.json()["parameters"], (json{{"rate", 3.0}, {"top", 1.5}}));
  EXPECT_THAT(durations(executed.expand()), ElementsAre(0.5, 1));
}

TEST(Protocol, RefusesParametersItDoesNotHaveAndValuesThatDoNotFit) {
  const auto protocol = Protocol::from_json(with_parameters());
  try {
    protocol.with({.parameters = {{"rte", 3}}});
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::bad_protocol);
    ASSERT_EQ(error.problems().size(), 1U);
    EXPECT_EQ(error.problems()[0].path, "/parameters/rte");
    EXPECT_EQ(error.problems()[0].hint, "did you mean \"rate\"?");
  }
  try {
    protocol.expand({.parameters = {{"rate", -3}}});
    FAIL() << "accepted";
  } catch (const Error& error) {
    ASSERT_EQ(error.problems().size(), 1U);
    EXPECT_EQ(error.problems()[0].path, "/segments/0/rate");
    EXPECT_EQ(error.problems()[0].given, -3.0);
  }
  EXPECT_THROW(protocol.expand({.parameters = {{"rate", std::nan("")}}}), Error);
}

TEST(Protocol, TurnsVoltsIntoAFieldByTheLayerThickness) {
  auto given = program({{{"kind", "triangle"}, {"low", 0}, {"high", 150}, {"rate", 5}}});
  given["unit"] = "V";
  const auto bare = Protocol::from_json(given);
  try {
    bare.expand();
    FAIL() << "expanded without a thickness";
  } catch (const Error& error) {
    EXPECT_EQ(error.problems().at(0).path, "/layer_thickness_m");
  }
  EXPECT_EQ(bare.expand({.layer_thickness = 1e-4}).maximum(), 1.5e6);
  EXPECT_EQ(bare.expand({.layer_thickness = 1e-4}).max_slew(), 5e4);
  EXPECT_THROW(bare.expand({.layer_thickness = -1}), Error);

  given["layer_thickness_m"] = 5e-5;
  const auto own = Protocol::from_json(given);
  EXPECT_EQ(own.layer_thickness(), 5e-5);
  EXPECT_EQ(own.expand().maximum(), 3e6);
  EXPECT_EQ(own.expand({.layer_thickness = 1e-4}).maximum(), 1.5e6);
  EXPECT_EQ(own.with({.layer_thickness = 1e-4}).json()["layer_thickness_m"], 1e-4);
}

TEST(Protocol, NamesASampleRateOrSuggestsOne) {
  auto given = program({{{"kind", "triangle"}, {"low", 0}, {"high", 150}, {"rate", "$rate"}}});
  given["unit"] = "V";
  given["parameters"] = {{"rate", 5}};
  EXPECT_EQ(Protocol::from_json(given).sample_rate(), 20);
  EXPECT_EQ(Protocol::from_json(given).with({.parameters = {{"rate", 5000}}}).sample_rate(), 20000);
  given["sample_rate_Hz"] = 7;
  EXPECT_EQ(Protocol::from_json(given).sample_rate(), 7);
  EXPECT_EQ(Protocol::from_json(program({{{"kind", "hold"}, {"time", 1}}})).sample_rate(), std::nullopt);
}

TEST(Protocol, SaysWhatTheSpecimenWorksAgainst) {
  auto given = program({{{"kind", "hold"}, {"time", 1}}});
  EXPECT_FALSE(Protocol::from_json(given).load().prestress);
  given["load"] = {{"spring_stiffness_N_per_m", 2.7e6}, {"prestress_Pa", "$p"}};
  given["parameters"] = {{"p", 4e6}};
  EXPECT_EQ(Protocol::from_json(given).load().spring_stiffness, 2.7e6);
  EXPECT_EQ(Protocol::from_json(given).load().prestress, 4e6);
  given["parameters"] = {{"p", 2 * prestress_min}};
  EXPECT_EQ(validate(given).at(0).path, "/load/prestress_Pa");
}

class File : public testing::Test {
 protected:
  std::string written(const std::string& text) {
    const auto path =
        testing::TempDir() + "protocol_test_" + testing::UnitTest::GetInstance()->current_test_info()->name();
    std::ofstream(path) << text;
    return path;
  }
};

TEST_F(File, IsReadAsAProtocol) {
  EXPECT_EQ(Protocol::from_file(written(with_parameters().dump())).json(), with_parameters());
}

TEST_F(File, ThatIsNotThereIsNotFound) {
  for (const char* path : {"/nowhere/at/all.json", "/dev/zero", "/tmp"}) {
    try {
      Protocol::from_file(path);
      FAIL() << path;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::not_found) << path;
    }
  }
}

TEST_F(File, OfPointsBecomesAProtocol) {
  const auto protocol = Protocol::from_csv_file(written("t,E\n0,1.5\n2,-0.5\n3,-0.5\n"));
  EXPECT_THAT(corner_levels(protocol.expand()), ElementsAre(1.5, -0.5, -0.5));
  EXPECT_THAT(durations(protocol.expand()), ElementsAre(2, 1));
  EXPECT_EQ(Protocol::from_json(protocol.json()).json(), protocol.json());
}

TEST_F(File, OfPointsSaysTheLineThatIsWrong) {
  try {
    Protocol::from_csv_file(written("t,E\n0,1.5\n1,2,3\n2,\xff\xfe\n"));
    FAIL() << "accepted";
  } catch (const Error& error) {
    ASSERT_EQ(error.problems().size(), 2U);
    EXPECT_THAT(error.problems()[0].message, testing::HasSubstr("line 3"));
    EXPECT_THAT(error.problems()[1].message, testing::HasSubstr("line 4"));
    EXPECT_NO_THROW(error.data().dump());
  }
}

}  // namespace
}  // namespace ferrobench::protocols
