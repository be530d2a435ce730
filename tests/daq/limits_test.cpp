#include "daq/guard/limits.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "daq/guard/check.h"
#include "protocols/protocol.h"

namespace ferrobench::daq {
namespace {

TEST(Limits, DefaultsAreValid) {
  EXPECT_TRUE(problems(Limits{}).empty());
}

TEST(Limits, DefaultsLetEveryShippedExperimentRun) {
  const auto names = protocols::library_names();
  ASSERT_FALSE(names.empty());
  for (const auto& name : names) {
    const auto waveform = protocols::library_protocol(name).expand({.layer_thickness = 1e-4});
    for (const double rate : {std::max(50.0, waveform.sampling()), 10000.0}) {
      const auto found = check({waveform, rate}, Limits{});
      EXPECT_TRUE(found.empty()) << name << " " << to_json(found.empty() ? Problem{} : found[0]).dump();
    }
  }
}

TEST(Limits, TellsEveryProblemAtOnce) {
  const auto json = nlohmann::json::parse(
      R"({"field_min": 1, "slew": 0, "stop_slew": 1e6, "force_max": 5, "force_min": 7, "felt": 1})");
  try {
    limits_from_json(json);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::invalid_params);
    ASSERT_EQ(error.problems().size(), 3U);
    EXPECT_EQ(error.problems()[0].path, "/field_min");
    EXPECT_EQ(error.problems()[1].path, "/slew");
    EXPECT_EQ(error.problems()[2].path, "/felt");
  }
}

TEST(Limits, AStopTakesNoLongerThanItMay) {
  for (const auto& change : {nlohmann::json{{"stop_slew", 1}}, nlohmann::json{{"field_max", 1.1e7}},
                             nlohmann::json{{"field_min", -1.1e7}}, nlohmann::json{{"stop_time", 1}}}) {
    auto all = write_json(Limits{});
    all.update(change);
    try {
      limits_from_json(all);
      ADD_FAILURE() << change;
    } catch (const Error& error) {
      ASSERT_EQ(error.problems().size(), 1U);
      const auto& problem = error.problems()[0];
      EXPECT_EQ(problem.path, "/stop_slew");
      EXPECT_EQ(problem.unit, "V/m/s");
      all["stop_slew"] = problem.allowed["from"];
      EXPECT_NO_THROW(limits_from_json(all)) << change;
    }
  }
  EXPECT_NO_THROW(limits_from_json({{"stop_slew", 1.6e4}, {"stop_time", 100}}));
}

TEST(Limits, MustFitEachOther) {
  Limits limits;
  limits.field_min = limits.field_max = 0;
  limits.slew = 1e5;
  limits.force_max = limits.force_min - 1;
  const auto found = problems(limits);
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[0].path, "/field_max");
  EXPECT_EQ(found[1].path, "/stop_slew");
  EXPECT_EQ(found[2].path, "/force_max");
}

}  // namespace
}  // namespace ferrobench::daq
