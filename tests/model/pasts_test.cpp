// Pasts that a fit finds: the measurement is a simulation after one of them.
#include "model/inference/search/pasts.h"

#include <gtest/gtest.h>

#include "model/inference/dataset/bench.h"
#include "model/inference/study/fit.h"
#include "tests/model/measured.h"

namespace ferrobench::model {
namespace {

using protocols::FirstState;
using protocols::Past;
using protocols::PastKind;

constexpr SimulationOptions simulation{.tolerance = 1e-4, .domains = 128, .shift = 0};

// Up to a field that switches all, down to one that does not, and back.
Program lopsided() {
  return {{{0, 0}, {0.1, 1.6e6}, {0.25, -9e5}, {0.3, 0}}, 2e-3};
}

Past visited(double level) {
  return {PastKind::visited, level < 0 ? FirstState::poled_plus : FirstState::poled_minus, {{level, 0.1}}};
}

recordings::Recording after(const Past& past) {
  auto options = simulation;
  options.past = &past;
  return measured_on(quick_specimen(), lopsided(), options);
}

Past likeliest(const Model& model, recordings::Recording recording, bool heights_are_free) {
  const std::vector<RecordingData> data{prepare(std::move(recording))};
  const std::vector<Model> models{model};
  return choose_pasts(models, data, {{simulation, true}, heights_are_free}).at(0);
}

TEST(Pasts, AreFoundUnderTheRightModel) {
  for (const auto kind : {PastKind::poled_plus, PastKind::poled_minus, PastKind::unpoled, PastKind::cycled})
    EXPECT_EQ(likeliest(quick_specimen(), after({kind}), false).kind, kind) << protocols::in_words({kind});
  const auto found = likeliest(quick_specimen(), after(visited(-9.5e5)), false);
  ASSERT_EQ(found.kind, PastKind::visited);
  EXPECT_EQ(found.from, FirstState::poled_plus);
  EXPECT_NEAR(found.levels.at(0).field, -9.5e5, 5e4);
}

// By a tester that cycled it where little switches.
TEST(Pasts, OfASpecimenThatWasPartlyPoledHaveItsDegree) {
  const Program weak{{{0, 0}, {0.1, 7e5}, {0.3, -7e5}, {0.4, 0}}, 2e-3};
  for (const double poling : {-0.55, 0.25}) {
    const Past past{.kind = PastKind::cycled, .from = FirstState::partly_poled, .poling = poling};
    auto options = simulation;
    options.past = &past;
    const auto found = likeliest(quick_specimen(), measured_on(quick_specimen(), weak, options), false);
    EXPECT_EQ(found.from, FirstState::partly_poled) << protocols::in_words(found);
    EXPECT_NEAR(found.poling.value_or(9), poling, 0.05);
  }
}

TEST(Pasts, AreFoundUnderAModelOfTheWrongHeight) {
  auto start = quick_specimen();
  start.material.remanent_polarization *= 1.4;
  start.material.barrier *= 1.4;  // so that it switches at the same field
  start.material.activation_volume /= 1.4;
  start.material.piezoelectric_180 *= 0.6;
  for (const auto kind : {PastKind::poled_plus, PastKind::poled_minus})
    EXPECT_EQ(likeliest(start, after({kind}), true).kind, kind) << protocols::in_words({kind});
}

TEST(Pasts, ThatAreRecordedStay) {
  auto recording = after({PastKind::poled_plus});
  recording.header.past = {PastKind::poled_minus};
  EXPECT_EQ(likeliest(quick_specimen(), std::move(recording), false), Past{PastKind::poled_minus});
}

FitResult fitted(const Model& start, std::vector<recordings::Recording> recordings) {
  FitOptions options;
  for (const auto* path :
       {"material.remanent_polarization", "material.barrier", "polycrystal.interaction_field_std"})
    options.free.push_back(free_parameter(start, path));
  options.starts = 1;
  options.simulation = simulation;
  return fit(start, *recording_residuals(std::move(recordings)), options);
}

TEST(Pasts, AreFoundByAFitEachForItsRecording) {
  auto known = after({PastKind::poled_plus});
  known.header.past = {PastKind::poled_plus};
  auto start = quick_specimen();
  start.material.remanent_polarization *= 1.15;
  start.material.barrier *= 1.1;
  std::vector<recordings::Recording> recordings{after({PastKind::poled_minus}), after(visited(-9.5e5)),
                                                known};
  const auto result = fitted(start, recordings);
  ASSERT_EQ(result.pasts.size(), 3U);
  EXPECT_EQ(result.pasts[0].past.kind, PastKind::poled_minus);
  EXPECT_TRUE(result.pasts[0].chosen);
  EXPECT_EQ(result.pasts[1].past.kind, PastKind::visited);
  EXPECT_FALSE(result.pasts[2].chosen);
  ASSERT_TRUE(result.residuals);
  for (const auto& [name, rms] : result.residuals->summary(result.model, {.simulation = simulation}))
    EXPECT_LT(rms, 0.5) << name;
  EXPECT_NEAR(result.model.material.remanent_polarization, quick_specimen().material.remanent_polarization,
              2e-3);
}

TEST(Pasts, AreKeptByAFitThatIsStopped) {
  auto start = quick_specimen();
  start.material.barrier *= 1.1;
  int left = 300;
  FitOptions options;
  options.free.push_back(free_parameter(start, "material.barrier"));
  options.starts = 1;
  options.simulation = simulation;
  options.progress = [&](const FitProgress&) { return --left > 0; };
  std::vector<recordings::Recording> recordings{after({PastKind::poled_minus})};
  const auto result = fit(start, *recording_residuals(std::move(recordings)), options);
  EXPECT_TRUE(std::isfinite(result.cost_after));
  EXPECT_LE(result.cost_after, result.cost_before);
}

// A search for what a model misses takes the recorded past.
TEST(Pasts, AreThoseOfABenchAsRecorded) {
  auto minus = after({PastKind::poled_minus});
  minus.header.past = {PastKind::poled_minus};
  std::vector<std::string> warnings;
  const auto bench = inference::prepare_bench(quick_specimen(), {{"minus", minus}}, 1000, warnings);
  const auto simulated = inference::simulate_bench(quick_specimen(), bench.at(0), simulation);
  for (std::size_t c = 0; c < bench[0].channels.size(); ++c) {
    const auto& measured = bench[0].channels[c];
    if (measured.channel == recordings::Channel::charge) {
      EXPECT_NEAR(simulated[c][0], measured.value[0], 1e-3 * measured.range);
    }
  }
}

}  // namespace
}  // namespace ferrobench::model
