// Long work ends when it is told to, in the middle of whatever goes on; and how long its preparation takes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <ctime>
#include <random>

#include "model/inference/dataset/bench.h"
#include "model/inference/study/discover.h"
#include "model/inference/study/fit.h"
#include "tests/model/measured.h"

namespace ferrobench::model {
namespace {

using recordings::Channel;

constexpr SimulationOptions coarse{.tolerance = 1e-3, .domains = 32};
constexpr int rows_of_a_segment = 10;

// So many ramps up and down, with 1 % of noise.
recordings::Recording triangles(int segments) {
  std::vector<std::pair<double, double>> corners;
  for (int i = 0; i <= segments; ++i) corners.emplace_back(i, i % 2 == 0 ? 0 : 1.5e6);
  auto r = measured_on(library_model("soft-pzt"), Program(corners, 1.0 / rows_of_a_segment), coarse);
  std::mt19937_64 random(1);
  for (const auto channel : {Channel::charge, Channel::displacement, Channel::force}) {
    auto values = r.at(channel);
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    std::normal_distribution<double> noise(0, 0.01 * (*high - *low));
    for (auto& v : values) v += noise(random);
    r.set(channel) = std::move(values);
  }
  return r;
}

struct Work {
  double steps = 0, seconds = 0;
};
Work preparing(int segments) {
  const std::vector<NamedRecording> recordings{{"triangles", triangles(segments)}};
  Work out;
  const std::function<bool()> count = [&] { return ++out.steps < 0; };
  std::vector<std::string> warnings;
  const auto begin = std::clock();
  const auto bench = inference::prepare_bench(library_model("soft-pzt"), recordings, 40000, warnings, &count);
  out.seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  EXPECT_EQ(bench.front().knot_time.size(), static_cast<std::size_t>(segments) + 1);
  return out;
}

TEST(Stopping, PreparationGrowsWithTheSegmentsNotWithTheirSquare) {
  const auto few = preparing(1000), many = preparing(4000);
  EXPECT_GT(few.steps, 1000);
  EXPECT_LT(many.steps, 5 * few.steps);
  EXPECT_LT(many.seconds, 10 * few.seconds);
}

class StopsWithin : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Discover, StopsWithin,
                         testing::Values("reading the recordings", "choosing how finely to simulate",
                                         "recalibrating the model", "recalibrating from other starts",
                                         "trying every effect", "the proof"),
                         [](const auto& i) {
                           std::string name = i.param;
                           std::replace(name.begin(), name.end(), ' ', '_');
                           return name;
                         });

// The stop comes in the middle of a simulation, and not one step more is made.
TEST_P(StopsWithin, TheStep) {
  bool reached = false;
  int asked = 0, late = 0;
  DiscoverOptions options;
  options.candidates = {"electrostriction"};
  options.threads = 1;
  options.progress = [&](const DiscoverProgress& p) {
    reached = reached || p.stage == GetParam();
    return true;
  };
  options.stop = [&] {
    if (!reached) return false;
    if (asked > 20) ++late;
    return ++asked > 20;
  };
  try {
    discover(library_model("soft-pzt"), {{"triangles", triangles(24)}}, options);
    FAIL() << "it was not stopped";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::cancelled) << e.what();
  }
  EXPECT_TRUE(reached);
  EXPECT_EQ(asked, 21);
  EXPECT_EQ(late, 0);
}

TEST(Stopping, ASearchInTables) {
  int asked = 0;
  DiscoverOptions options;
  options.stop = [&] { return ++asked > 100; };
  options.threads = 1;
  EXPECT_THROW(discover_in_tables(library_model("mcl-op30-linear"), {"3.13"}, options), Error);
  EXPECT_EQ(asked, 101);
}

TEST(Stopping, AFitKeepsTheBestSoFar) {
  const auto truth = library_model("soft-pzt");
  std::vector<recordings::Recording> recordings{triangles(8)};
  const auto target = recording_residuals(std::move(recordings));
  FitOptions options;
  options.simulation = coarse;
  int asked = 0;
  const std::function<bool()> count = [&] { return ++asked < 0; };
  options.simulation.stop = &count;
  std::vector<double> residuals(target->size());
  target->evaluate(truth, {.simulation = options.simulation}, residuals);
  const int once = asked;
  ASSERT_GT(once, 20);
  asked = 0;
  const std::function<bool()> later = [&] { return ++asked > 5 * once + 10; };
  options.simulation.stop = &later;
  options.free = {free_parameter(truth, "material.barrier")};
  const auto result =
      fit(with_parameters(truth, {{"material.barrier", 1.1 * truth.material.barrier}}), *target, options);
  EXPECT_TRUE(result.stopped);
  EXPECT_EQ(asked, 5 * once + 11);
  EXPECT_LE(result.cost_after, result.cost_before);
}

}  // namespace
}  // namespace ferrobench::model
