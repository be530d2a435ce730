// Tables of one tester's file, of which each begins where those before it left the specimen.
#include "model/inference/dataset/succession.h"

#include <gtest/gtest.h>

#include <cmath>

#include "model/inference/search/pasts.h"
#include "model/inference/study/fit.h"
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

// The hypotheses are the six of whether there were cycles, and of the states that have a name.
constexpr std::size_t cycled_from_unpoled = 0, cycled_from_poled_plus = 2, from_unpoled = 3;

// The tables in their order, which the recordings need not have.
TEST(Succession, IsTheWayThroughAllThatWasNotWipedOut) {
  auto recordings = tables(rising);
  std::ranges::reverse(recordings);
  const auto found = successions(prepared(recordings));
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].recordings, (std::vector<std::size_t>{3, 2, 1, 0}));
  ASSERT_EQ(found[0].hypotheses.size(), 6U);
  EXPECT_EQ(found[0].hypotheses[from_unpoled].front(), Past{PastKind::unpoled});
  EXPECT_EQ(fields(found[0].hypotheses[cycled_from_unpoled].front()),
            (std::vector<double>{1.6e6, -1.6e6, 0}));
  // The loop of 6e5 V/m lies well within that of 8e5, which does not lie well within that of 9e5.
  EXPECT_EQ(fields(found[0].hypotheses[from_unpoled].back()),
            (std::vector<double>{1.6e6, -1.6e6, 0, 8e5, -8e5, 0}));
  EXPECT_EQ(
      fields(found[0].hypotheses[cycled_from_unpoled].back()),
      (std::vector<double>{1.6e6, -1.6e6, 0, 1.6e6, -1.6e6, 0, 8e5, -8e5, 0, 8e5, -8e5, 0, 9e5, -9e5, 0}));
}

TEST(Succession, BeginsAnewWhereARecordingSaysWhatWasBefore) {
  auto recordings = tables(rising);
  recordings[1].header.past = {PastKind::poled_minus};
  const auto found = successions(prepared(recordings));
  for (const auto& pasts : found[0].hypotheses) EXPECT_EQ(pasts[1], Past{PastKind::poled_minus});
  const auto& next = found[0].hypotheses[from_unpoled][2];
  EXPECT_EQ(next.from, FirstState::poled_minus);
  EXPECT_EQ(fields(next), (std::vector<double>{6e5, -6e5, 0}));
}

// A tester measures its field, with noise that turns around at every sample.
TEST(Succession, HasNoLevelsOfNoise) {
  auto recordings = tables(rising);
  for (auto& r : recordings) {
    auto field = r.at(recordings::Channel::command);
    for (std::size_t k = 0; k < field.size(); ++k) field[k] += (k % 2 == 0 ? 1 : -1) * 5e3;
    r.set(recordings::Channel::command) = std::move(field);
  }
  const auto found = successions(prepared(recordings));
  const auto& levels = found[0].hypotheses[from_unpoled].back().levels;
  EXPECT_GE(levels.size(), 6U);
  EXPECT_LE(levels.size(), 8U);
}

TEST(Succession, KeepsASlowLoopThatAFastOneEncloses) {
  const std::array loops{Loop{6e5, 40}, Loop{9e5, 0.4}, Loop{9e5, 0.4}};
  const auto found = successions(prepared(tables(loops)));
  EXPECT_EQ(fields(found[0].hypotheses[from_unpoled].back()),
            (std::vector<double>{6e5, -6e5, 0, 9e5, -9e5, 0}));
}

TEST(Succession, HasAsManyRepeatsAsShow) {
  const std::vector<Loop> loops(20, Loop{9e5, 0.4});
  const auto found = successions(prepared(tables(loops)));
  EXPECT_EQ(found[0].hypotheses[from_unpoled].back().levels.size(), 8U * 3);
}

TEST(Succession, IsOfOneFileAndOneSpecimen) {
  const auto none = [](const std::vector<recordings::Recording>& recordings) {
    return successions(prepared(recordings)).empty();
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

// What is left out of a past does not show in what is simulated after it: loops of a tester that rise after
// slow ones, and repeats.
TEST(Succession, LeavesTheSpecimenAsItsWholePastDoes) {
  const std::array loops{Loop{1.4e6, 4},   Loop{1.4e6, 40},  Loop{8e5, 0.4}, Loop{1e6, 0.4},
                         Loop{1.2e6, 0.4}, Loop{1.4e6, 0.4}, Loop{8e5, 0.4}, Loop{8e5, 0.4}};
  const auto recordings = tables(loops);
  const auto found = successions(prepared(recordings));
  const auto& cycled = found.front().hypotheses[cycled_from_poled_plus];
  // Those of 8e5 and 1e6 V/m are not in it, of which there were two each.
  EXPECT_EQ(cycled.back().levels.size(), 3 * (2 * loops.size() - 1) - 3 * 4);
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    auto options = simulation;
    options.past = &cycled[i];
    const auto after =
        simulate(quick_specimen(), loops.at(i).program().time, loops.at(i).program().field, options);
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
  const auto presumed = chosen();
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    EXPECT_EQ(presumed[i].kind, PastKind::visited) << i;
    EXPECT_EQ(presumed[i].from, presumed[0].from) << i;  // there was one state before all of them
    EXPECT_GT(presumed[i].levels.size(), i == 0 ? 2U : 3U) << i;
  }
  // Somebody poled the specimen towards + between two tables.
  recordings[2] = table(rising[2], 3, {PastKind::poled_plus});
  EXPECT_EQ(chosen()[2], Past{PastKind::poled_plus});
}

// Numbers that were fitted beside a wrong past meet it well enough that no other one is likelier there: the
// fit stood at 2 to 3 % of the displacement's range.
TEST(Succession, IsDoubtedByNumbersThatWereFittedBesideAnotherPast) {
  for (const auto from : {FirstState::poled_plus, FirstState::unpoled}) {
    auto recordings = tables(rising);
    const Past truth{PastKind::cycled, from};
    recordings[2] = table(rising[2], 3, truth);
    const auto residuals = recording_residuals(recordings);
    auto start = quick_specimen();
    start.material.remanent_polarization *= 0.9;
    FitOptions options;
    options.starts = 1;
    options.simulation = simulation;
    for (const auto& p : default_free_parameters(start))
      if (p.path == "material.barrier" || p.path == "material.activation_volume" ||
          p.path == "material.remanent_polarization" || p.path == "polycrystal.interaction_field_std" ||
          p.path == "polycrystal.bias_field")
        options.free.push_back(p);
    const auto result = fit(start, *residuals, options);
    EXPECT_EQ(result.pasts.at(2).past, truth);
    EXPECT_EQ(result.pasts.at(3).past.kind, PastKind::visited);
    for (const auto& [name, percent] : result.residuals->summary(result.model, {.simulation = simulation}))
      EXPECT_LT(percent, 0.01) << name;
  }
}

}  // namespace
}  // namespace ferrobench::model
