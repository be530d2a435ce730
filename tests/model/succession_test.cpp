// Tables of one tester's file, of which each begins where those before it left the specimen.
#include "model/inference/dataset/succession.h"

#include <gtest/gtest.h>

#include <cmath>

#include "model/inference/search/pasts.h"
#include "model/on_recording.h"
#include "tests/model/measured.h"

namespace ferrobench::model {
namespace {

using protocols::FirstState;
using protocols::Past;
using protocols::PastKind;

constexpr SimulationOptions simulation{.tolerance = 1e-4, .domains = 128, .shift = 0};

// Loops around zero that a tester measures, each after a cycle that it does not record. Levels in V/m.
struct Loop {
  double amplitude, period;
  Program program() const {
    return {{{0, 0}, {period / 4, amplitude}, {3 * period / 4, -amplitude}, {period, 0}}, period / 400};
  }
  std::vector<protocols::VisitedLevel> levels() const {
    return {{amplitude, period / 4}, {-amplitude, period / 2}, {0, period / 4}};
  }
};

// The table of a tester's file that this loop is, measured after all that came before.
recordings::Recording table(const Loop& loop, int number, const Past& past) {
  auto options = simulation;
  options.past = &past;
  auto out = measured_on(quick_specimen(), loop.program(), options);
  out.header.title += ", table " + std::to_string(number);
  out.header.device = {{"driver", "import"}, {"source", "loops.dat"}, {"table", number}};
  return out;
}

// Tables of one file; nothing of what went before each of them is left out.
std::vector<recordings::Recording> tables(std::span<const Loop> loops) {
  std::vector<recordings::Recording> out;
  Past past{PastKind::visited, FirstState::poled_plus};
  for (const auto& loop : loops) {
    past = protocols::and_then(past, loop.levels());
    out.push_back(table(loop, static_cast<int>(out.size()) + 1, past));
    past = protocols::and_then(past, loop.levels());
  }
  return out;
}

std::vector<RecordingData> prepared(const std::vector<recordings::Recording>& recordings) {
  std::vector<RecordingData> out;
  out.reserve(recordings.size());
  for (const auto& r : recordings) out.push_back(prepare(r));
  return out;
}

constexpr std::array rising{Loop{1.6e6, 0.4}, Loop{6e5, 0.4}, Loop{8e5, 0.4}, Loop{9e5, 0.4}};

std::vector<double> fields(const Past& past) {
  std::vector<double> out;
  for (const auto& level : past.levels) out.push_back(std::round(level.field / 1e5) * 1e5);
  return out;
}

TEST(Succession, HasTheExtremesThatWereNotWipedOutAndACycleOfItsOwn) {
  auto recordings = tables(rising);
  std::ranges::reverse(recordings);  // the tables' numbers count, not the order in which they are given
  const auto found = pasts_by_succession(prepared(recordings));
  EXPECT_TRUE(found[3].empty());
  // The loop of 6e5 V/m lies within that of 8e5, which lies within that of 1.6e6.
  const std::vector<double> before{1.6e6, -1.6e6, 8e5, -8e5, 0};
  auto cycled = before;
  cycled.insert(cycled.end(), {9e5, -9e5, 0});
  ASSERT_EQ(found[0].size(), 6U);
  for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(fields(found[0][i]), i < 3 ? cycled : before);
}

TEST(Succession, KeepsASlowLoopThatAFastOneEncloses) {
  const std::array loops{Loop{8e5, 40}, Loop{8e5, 0.4}, Loop{8e5, 0.4}};
  const auto found = pasts_by_succession(prepared(tables(loops)));
  EXPECT_EQ(fields(found[2].back()), (std::vector<double>{8e5, -8e5, 8e5, -8e5, 0}));
}

TEST(Succession, IsOfOneFileAndOneSpecimen) {
  const auto none = [](const std::vector<recordings::Recording>& recordings) {
    return std::ranges::all_of(pasts_by_succession(prepared(recordings)), &std::vector<Past>::empty);
  };
  const auto recordings = tables(std::array{rising[0], rising[1]});
  EXPECT_FALSE(none(recordings));
  auto others = recordings;
  others[1].header.device["source"] = "other.dat";
  EXPECT_TRUE(none(others));
  others = recordings;
  others[1].header.specimen.area *= 2;
  EXPECT_TRUE(none(others));
  others = recordings;
  others[1].header.device["driver"] = "virtual";
  EXPECT_TRUE(none(others));
  for (const nlohmann::json& device :
       {nlohmann::json(), nlohmann::json("import"), nlohmann::json{{"driver", "import"}, {"table", "2"}}}) {
    others[1].header.device = device;
    EXPECT_TRUE(none(others)) << device;
  }
}

// What is left out of a past does not show in what is simulated after it.
TEST(Succession, LeavesTheSpecimenAsItsWholePastDoes) {
  const auto recordings = tables(rising);
  const auto found = pasts_by_succession(prepared(recordings));
  for (std::size_t i = 1; i < recordings.size(); ++i) {
    const auto& short_past = found[i][2];
    ASSERT_EQ(short_past.from, std::nullopt);  // poled towards +
    auto options = simulation;
    options.past = &short_past;
    const auto after =
        simulate(quick_specimen(), rising.at(i).program().time, rising.at(i).program().field, options);
    for (const auto channel : {recordings::Channel::charge, recordings::Channel::displacement}) {
      const auto& measured = recordings[i].at(channel);
      const auto& simulated = channel_of(after, channel);
      const auto [low, high] = std::ranges::minmax(measured);
      double off = 0;
      for (std::size_t k = 0; k < measured.size(); ++k)
        off = std::max(off, std::abs(simulated[k] - measured[k]));
      EXPECT_LT(off, 5e-3 * (high - low)) << i;
    }
  }
}

// A degree of poling, which is free, would make up for some of what the model misses.
TEST(Succession, IsPresumedUnlessARecordingContradictsIt) {
  auto wrong = quick_specimen();
  wrong.material.barrier *= 1.05;
  wrong.polycrystal.interaction_field_std *= 1.2;
  auto recordings = tables(rising);
  const std::vector<Model> models{wrong};
  const auto chosen = [&] { return choose_pasts(models, prepared(recordings), {{simulation, true}}); };
  for (std::size_t i = 1; i < recordings.size(); ++i) {
    EXPECT_EQ(chosen()[i].kind, PastKind::visited) << i;
    EXPECT_GT(chosen()[i].levels.size(), 3U) << i;
  }
  // Somebody poled the specimen towards + between two tables.
  recordings[2] = table(rising[2], 3, {PastKind::poled_plus});
  EXPECT_EQ(chosen()[2], Past{PastKind::poled_plus});
}

}  // namespace
}  // namespace ferrobench::model
