// The search for what a model misses, on small benches made by the simulator at other settings and quadrature
// than the search's own. How often it is right is the campaign's business (tests/campaign).
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <set>

#include "model/inference/dataset/bench.h"
#include "model/inference/dataset/held_out.h"
#include "model/inference/observation/noise.h"
#include "model/inference/parameters/parameters.h"
#include "model/inference/report/discovery_report.h"
#include "model/inference/residuals/whitened_recordings.h"
#include "model/inference/search/multistart.h"
#include "model/inference/selection/forward_selection.h"
#include "model/inference/selection/residual_basis.h"
#include "model/inference/solver/multifidelity.h"
#include "model/inference/study/discover.h"
#include "model/inference/study/fit.h"
#include "model/inference/study/incumbent.h"
#include "model/inference/study/model_error.h"
#include "model/inference/study/unknown_pasts.h"
#include "model/inference/study/validation.h"
#include "model/simulator.h"
#include "recordings/file/reader.h"

namespace ferrobench::model {
namespace {

using recordings::Channel;
using testing::HasSubstr;

Model given() {
  auto m = library_model("soft-pzt");
  m.effects.clear();
  return m;
}

// The bench as it is: every parameter a few percent off what is given.
Model real_bench() {
  auto m = given();
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  std::vector<std::pair<std::string, double>> moved;
  for (const auto& path : parameter_paths(m)) {
    const double value = get_parameter(m, path);
    if ((path.starts_with("material.") || path.starts_with("polycrystal.")) && value != 0 &&
        path != "material.temperature")
      moved.emplace_back(path, value * std::exp(0.06 * normal(random)));
  }
  return with_parameters(m, moved);
}

struct Plan {
  std::string name;
  std::vector<std::pair<double, double>> corners;
  double prestress;
};

const std::vector<Plan>& plans() {
  static const std::vector<Plan> all{
      {"slow", {{0, 0}, {4, 2e6}, {12, -2e6}, {20, 2e6}, {24, 0}}, 8e6},
      {"fast", {{0, 0}, {.4, 2e6}, {1.2, -2e6}, {2, 2e6}, {2.4, 0}}, 8e6},
      {"holds",
       {{0, 0}, {1, 1.5e6}, {2.9, -.6e6}, {8, -.6e6}, {9.8, 1.5e6}, {12.3, -1e6}, {17, -1e6}, {20, 1.5e6}},
       4e6},
      {"pressed",
       {{0, 0}, {1, 1.5e6}, {2.9, -.6e6}, {8, -.6e6}, {9.8, 1.5e6}, {12.3, -1e6}, {17, -1e6}, {20, 1.5e6}},
       12e6},
      {"minor", {{0, 0}, {1, 2e6}, {2, -.5e6}, {3, 1.5e6}, {4, -1e6}, {5, 2e6}, {6, 0}}, 8e6}};
  return all;
}

recordings::Recording record(Model m, const Plan& plan, std::uint64_t seed,
                             const protocols::Past* past = nullptr) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  m.load.prestress = plan.prestress;
  recordings::Recording r;
  std::vector<double> command;
  constexpr int rows = 900;
  std::size_t leg = 0;
  for (int i = 0; i <= rows; ++i) {
    const double t = plan.corners.back().first * i / rows;
    while (leg + 2 < plan.corners.size() && t > plan.corners[leg + 1].first) ++leg;
    const auto [t0, e0] = plan.corners[leg];
    const auto [t1, e1] = plan.corners[leg + 1];
    r.time.push_back(t);
    command.push_back(e0 + (e1 - e0) * (t - t0) / (t1 - t0));
  }
  const auto t = simulate(m, r.time, command, {.tolerance = 3e-5, .domains = 1500, .shift = 5, .past = past});
  r.header.specimen = {m.name, m.actuator.length, m.actuator.area, m.actuator.layer_thickness,
                       m.actuator.layer_count};
  r.header.load = {m.load.spring_stiffness, m.load.prestress};
  r.set(Channel::command) = command;
  const auto put = [&](Channel channel, std::vector<double> values, double noise) {
    for (double& v : values) v += noise * normal(random);
    r.set(channel) = std::move(values);
  };
  put(Channel::field, t.field, 5e3);
  put(Channel::charge, t.charge, 3e-6);
  put(Channel::displacement, t.displacement, 5e-8);
  put(Channel::force, t.force, 0.15);
  return r;
}

std::vector<NamedRecording> measure(const Model& m) {
  std::vector<NamedRecording> out;
  std::uint64_t seed = 10;
  for (const auto& plan : plans()) out.push_back({plan.name, record(m, plan, ++seed)});
  return out;
}

TEST(Discrepancy, TheStory) {
  auto bench = real_bench();
  bench.effects.push_back({"electrostriction", {{"coefficient", 3e-17}}});
  const auto recordings = measure(bench);

  const auto found = discover(given(), recordings);
  ASSERT_EQ(found.verdict, Verdict::named) << text_report(found);
  ASSERT_EQ(found.explanations.front().effects.size(), 1U);
  const auto& effect = found.explanations.front().effects.front();
  const auto& leave_one_out = found.explanations.front().leave_one_out;
  ASSERT_TRUE(leave_one_out);
  EXPECT_EQ(leave_one_out->recordings, found.train.recordings.size());
  EXPECT_EQ(leave_one_out->better, leave_one_out->recordings);
  EXPECT_GT(leave_one_out->gain, 0);
  EXPECT_EQ(effect.id, "electrostriction");
  EXPECT_NEAR(effect.parameters.front().value, 3e-17, 3e-18);
  EXPECT_LT(effect.parameters.front().low, effect.parameters.front().value);
  EXPECT_GT(effect.parameters.front().high, effect.parameters.front().value);
  EXPECT_EQ(found.family, Family::strain);
  ASSERT_FALSE(found.held_out.recordings.empty());
  EXPECT_GT(found.held_out.before.at(Channel::displacement), 1.3);
  EXPECT_LT(found.held_out.after.at(Channel::displacement), 1.1);

  EXPECT_GT(found.share, 0.9);
  EXPECT_GT(found.share_held_out, 0.9);
  EXPECT_FALSE(found.remainder);
  ASSERT_EQ(found.added.size(), 1U);
  EXPECT_EQ(found.added.front().term.id, "electrostriction");
  for (const auto& past : found.pasts) EXPECT_EQ(past.past.kind, protocols::PastKind::poled_plus);

  // What was found is a model like any other, and explains the bench.
  const auto improved = model_from_json(to_json(found.improved));
  const auto again = discover(improved, recordings);
  EXPECT_EQ(again.verdict, Verdict::nothing_missing) << text_report(again);
}

// What shows in slow recordings that are learned from, and not in fast ones that are locked away, where it
// would show ten times as much, is no property of the bench.
TEST(Discrepancy, WhatTheLockedRecordingsRefuteIsNotNamed) {
  const auto bench = real_bench();
  auto delayed = bench;
  delayed.effects.push_back({"displacement_delay", {{"delay", 3e-3}}});
  auto recordings = measure(bench);
  for (const std::size_t i : {0, 2, 3}) recordings[i].recording = record(delayed, plans()[i], 20 + i);
  const auto found = discover(given(), recordings, {.held_out = {"fast", "minor"}});
  EXPECT_EQ(found.verdict, Verdict::unknown) << text_report(found);
  ASSERT_EQ(found.doubted.size(), 1U);
  EXPECT_THAT(found.doubted.front().id, testing::StartsWith("displacement_"));
  EXPECT_TRUE(std::ranges::all_of(found.added, &AddedTerm::empirical));
  EXPECT_LE(found.held_out.after.at(Channel::displacement),
            1.01 * found.held_out.before.at(Channel::displacement));
  EXPECT_THAT(text_report(found), HasSubstr("refuted by the recordings that were locked away"));
}

// A tone far above half of most sampling rates, which looks like noise; a limit that only the fastest ramps
// pass; a drive that is known by a noisy measurement only, with a gain and an offset.
TEST(Discrepancy, NamesAnAliasedTone) {
  auto bench = real_bench();
  bench.effects.push_back({"mains_pickup", {{"amplitude", 4e-7}, {"frequency", 120.85}}});
  const auto found = discover(given(), measure(bench));
  ASSERT_EQ(found.verdict, Verdict::named) << text_report(found);
  const auto& effect = found.explanations.front().effects.front();
  EXPECT_EQ(effect.id, "mains_pickup");
  EXPECT_NEAR(effect.parameters.at(1).value, 120.85, 0.05);
}

TEST(Discrepancy, NamesALimitThatFewRampsPass) {
  auto bench = real_bench();
  bench.effects.push_back({"amplifier_slew_limit", {{"rate", 4e6}}});
  const auto found =
      discover(given(), measure(bench), {.held_out = {"slow"}, .candidates = {}, .progress = {}});
  ASSERT_EQ(found.verdict, Verdict::named) << text_report(found);
  EXPECT_EQ(found.explanations.front().effects.front().id, "amplifier_slew_limit");
  EXPECT_NEAR(found.explanations.front().effects.front().parameters.front().value, 4e6, 4e4);
}

// What shows in a locked recording alone is no "nothing is missing".
TEST(Discrepancy, LearnsFromALockedRecordingThatIsNotExplained) {
  auto recordings = measure(real_bench());
  std::vector<std::string> warnings;
  const auto held =
      inference::choose_held_out(inference::prepare_bench(given(), recordings, 40000, warnings));
  const auto locked = static_cast<std::size_t>(std::ranges::find(held, true) - held.begin());
  ASSERT_LT(locked, recordings.size());
  auto& [name, recording] = recordings[locked];
  auto drifting = recording.at(Channel::displacement);
  for (std::size_t i = 0; i < recording.size(); ++i) drifting[i] += 1e-7 * recording.time[i];
  recording.set(Channel::displacement) = drifting;

  const auto found = discover(given(), recordings);
  EXPECT_NE(found.verdict, Verdict::nothing_missing) << text_report(found);
  EXPECT_THAT(found.train.recordings, testing::Contains(name));
  EXPECT_FALSE(found.held_out.recordings.empty());
  EXPECT_THAT(found.health.warnings, testing::Contains(HasSubstr(name + ", locked away at first")));

  const auto kept = discover(given(), recordings, {.held_out = {name}, .candidates = {}, .progress = {}});
  EXPECT_THAT(kept.held_out.recordings, testing::ElementsAre(name));
  EXPECT_EQ(kept.verdict, Verdict::nothing_missing) << text_report(kept);
  EXPECT_THAT(kept.health.warnings, testing::Contains(HasSubstr("not explained in " + name)));
}

// What the second one does is a thousandth of the first one's part.
TEST(Discrepancy, NamesAWeakEffectBesideAStrongOne) {
  auto bench = real_bench();
  bench.effects.push_back({"charge_offset_current", {{"current", 6e-6}}});
  bench.effects.push_back({"displacement_nonlinearity", {{"coefficient", -800}}});
  const auto found = discover(given(), measure(bench));
  ASSERT_EQ(found.verdict, Verdict::named) << text_report(found);
  std::vector<std::string> ids;
  for (const auto& e : found.explanations.front().effects) ids.push_back(e.id);
  EXPECT_THAT(ids, testing::UnorderedElementsAre("charge_offset_current", "displacement_nonlinearity"));
}

// A model that is wrong by much is fitted beside its own error. Where an effect is the reason, noise judges
// it as soon as it is there, and nothing else is tried.
TEST(Discrepancy, ALargeEffectIsJudgedByNoiseAtOnce) {
  auto bench = real_bench();
  bench.effects.push_back({"contact_gap", {{"gap", 6e-6}}});
  DiscoverOptions options;
  std::set<std::string> stages;
  options.progress = [&](const DiscoverProgress& p) { return stages.insert(p.stage), true; };
  const auto found = discover(given(), measure(bench), options);
  ASSERT_EQ(found.verdict, Verdict::named) << text_report(found);
  EXPECT_EQ(found.explanations.front().effects.front().id, "contact_gap");
  EXPECT_TRUE(stages.contains("how wrong the model is"));
  for (const auto& stage : stages) EXPECT_FALSE(stage.starts_with("looking at")) << stage;
  EXPECT_GT(found.share_held_out, 0.99);
}

// What is locked shows little of it, and much of the creep beside it.
TEST(Discrepancy, ALargeEffectIsJudgedByNoiseWhereTheLockedRecordingsHardlyShowIt) {
  auto bench = real_bench();
  bench.effects.push_back({"load_cell_lag", {{"time_constant", 0.05}}});
  bench.effects.push_back({"load_cell_creep", {{"fraction", -0.1}, {"time_constant", 1}}});
  const auto found =
      discover(given(), measure(bench), {.held_out = {"slow"}, .candidates = {}, .progress = {}});
  ASSERT_EQ(found.verdict, Verdict::named) << text_report(found);
  std::vector<std::string> ids;
  for (const auto& e : found.explanations.front().effects) ids.push_back(e.id);
  EXPECT_THAT(ids, testing::UnorderedElementsAre("load_cell_lag", "load_cell_creep"));
}

// Recordings of 2 to 24 s tell the amplitude over the time constant of a relaxation of 1,000 s, and neither
// alone.
TEST(Discrepancy, NamesARelaxationMuchSlowerThanTheRecordings) {
  auto bench = given();
  bench.effects.push_back({"prestress_relaxation", {{"fraction", 0.2}, {"time_constant", 1000}}});
  const auto found = discover(given(), measure(bench));
  ASSERT_EQ(found.verdict, Verdict::named) << text_report(found);
  const auto& term = found.explanations.front().effects.front();
  EXPECT_EQ(term.id, "prestress_relaxation");
  EXPECT_NEAR(term.parameters[0].value / term.parameters[1].value, 2e-4, 2e-5);
}

// So far off that the recalibration by noise alone is stuck in another valley.
TEST(Discrepancy, AParameterFarOffIsNoEffect) {
  auto base = library_model("nec-single-crystal"), bench = base;
  bench.polycrystal.bias_field += 1.2e5;
  const auto found = discover(base, measure(bench));
  EXPECT_EQ(found.verdict, Verdict::nothing_missing) << text_report(found);
  EXPECT_TRUE(found.added.empty());
  EXPECT_NEAR(found.recalibrated.at("polycrystal.bias_field").to, bench.polycrystal.bias_field, 1e3);
}

// Without the spread of fields the recalibration goes to where the spread seems to be of no help.
TEST(Discrepancy, NamesWhatTheParametersHadMadeUpFor) {
  auto base = given();
  base.polycrystal.interaction_field_std = 0;
  auto bench = real_bench();
  bench.polycrystal.interaction_field_std = 7e4;
  const auto found = discover(base, measure(bench));
  ASSERT_EQ(found.verdict, Verdict::named) << text_report(found);
  EXPECT_EQ(found.explanations.front().effects.front().id, "interaction_field_distribution");
  EXPECT_NEAR(found.explanations.front().effects.front().parameters.front().value, 7e4, 4e3);
}

// Another program's trajectories of this model with noise: what two programs differ by is no effect.
TEST(Discrepancy, AnotherProgramIsNoEffect) {
  std::vector<NamedRecording> recordings;
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  for (const std::string name : {"full_loops", "creep_holds", "minor_loops"}) {
    auto r = recordings::read_recording(std::string(MODEL_REFERENCE) + "/polycrystal_" + name + ".h5");
    for (const auto channel : {Channel::field, Channel::charge, Channel::displacement, Channel::force}) {
      auto& values = *r.channels[static_cast<std::size_t>(channel)];
      const auto [low, high] = std::minmax_element(values.begin(), values.end());
      const double noise = 1e-3 * (*high - *low);
      for (double& v : values) v += noise * normal(random);
    }
    recordings.push_back({name, std::move(r)});
  }
  const auto model = model_from_json(recordings.front().recording.header.model);
  const auto found = discover(model, recordings);
  EXPECT_EQ(found.verdict, Verdict::nothing_missing) << text_report(found);
}

// A specimen that warms up from recording to recording: too little for any effect to gain by it, but not
// noise.
TEST(Discrepancy, WhatNoEffectExplainsIsUnknown) {
  std::vector<NamedRecording> recordings;
  auto bench = real_bench();
  std::uint64_t seed = 10;
  for (const auto& plan : plans()) {
    recordings.push_back({plan.name, record(bench, plan, ++seed)});
    bench.material.relaxation_time *= 0.96;
  }
  const auto found = discover(given(), recordings);
  EXPECT_EQ(found.verdict, Verdict::unknown) << text_report(found);
}

// The kinetics of a physics that is not the model's: rates that see a field with a play in it.
EffectSetting foreign_kinetics(double amplitude) {
  EffectSetting out{.id = "empirical_rate", .parameters = {}};
  for (const auto& p : find_effect(out.id).parameters) out.parameters.emplace_back(p.name, 0);
  const auto set = [&](std::string_view name, double value) {
    for (auto& [own, to] : out.parameters)
      if (own == name) to = value;
  };
  set("amplitude", amplitude);
  set("field_scale", 2e6);
  set("time_constant", 1);
  set("field_1", -3);
  set("field_3", 3);
  set("field_5", -3);
  set("field_7", 3);
  set("lag_order", 2);
  return out;
}

// It has no name, so nothing is named, and the gap is narrowed on recordings that were locked away all the
// same.
TEST(Discrepancy, WhatHasNoNameIsNarrowed) {
  auto bench = given();
  bench.effects.push_back(foreign_kinetics(1e5));
  const auto found = discover(given(), measure(bench));
  EXPECT_EQ(found.verdict, Verdict::unknown) << text_report(found);
  EXPECT_FALSE(found.added.empty());
  EXPECT_GT(found.share_held_out, 0.5) << text_report(found);
  EXPECT_NO_THROW(model_from_json(to_json(found.improved)));
}

// A spring that bends, and a search that may not name it: the table at the spring stands for it.
TEST(Discrepancy, ASpringWithoutANameIsNarrowed) {
  auto bench = real_bench();
  bench.effects.push_back({"spring_hardening", {{"coefficient", 1e4}}});
  const auto found = discover(given(), measure(bench), {.candidates = {"displacement_clipping"}});
  ASSERT_EQ(found.verdict, Verdict::unknown) << text_report(found);
  ASSERT_FALSE(found.added.empty()) << text_report(found);
  EXPECT_EQ(found.added.front().term.id, "empirical_spring") << text_report(found);
  EXPECT_GT(found.share_held_out, 0.9) << text_report(found);
  EXPECT_NO_THROW(model_from_json(to_json(found.improved)));
}

// Kinetics that the catalogue has no name for: they are found by the numbers that were hidden, and stay
// without a name.
TEST(Discrepancy, CorrectionsOfTheKineticsNarrowAGapWithoutAName) {
  const std::vector<EffectSetting> hidden{
      {"empirical_direct", {{"rate_ratio", 0.1}, {"barrier_ratio", 1.45}}},
      {"empirical_asymmetry", {{"log_ratio", 0.08}}},
      {"empirical_skewness", {{"skewness", -0.5}}},
      {"empirical_tails", {{"inverse_freedom", 0.25}}}};
  for (const auto& h : hidden) {
    SCOPED_TRACE(h.id);
    auto bench = real_bench();
    bench.effects.push_back(h);
    const auto found = discover(given(), measure(bench), {.candidates = {"displacement_clipping"}});
    ASSERT_EQ(found.verdict, Verdict::unknown) << text_report(found);
    ASSERT_FALSE(found.added.empty()) << text_report(found);
    const auto& first = found.added.front();
    EXPECT_EQ(first.term.id, h.id) << text_report(found);
    EXPECT_TRUE(first.empirical);
    for (std::size_t i = 0; i < h.parameters.size(); ++i) {
      const auto& [name, value] = h.parameters[i];
      EXPECT_NEAR(first.term.parameters.at(i).value, value, 0.1 * std::abs(value)) << name;
    }
    // Beside the tails the recalibration ends in a valley, with a compliance that is three of its standard
    // deviations off and 1.2 times the noise in the force.
    EXPECT_GT(found.share_held_out, h.id == "empirical_tails" ? 0.7 : 0.9) << text_report(found);
  }
}

// One effect is named, and stands in the answer after the empirical term beside which it was found.
void expect_named_beside(const Discovery& found, const std::string& term, const std::string& effect,
                         double value) {
  ASSERT_EQ(found.verdict, Verdict::named) << text_report(found);
  ASSERT_EQ(found.explanations.size(), 1U);
  ASSERT_EQ(found.explanations.front().effects.size(), 1U);
  EXPECT_EQ(found.explanations.front().effects.front().id, effect);
  ASSERT_EQ(found.added.size(), 2U) << text_report(found);
  EXPECT_EQ(found.added[0].term.id, term);
  EXPECT_TRUE(found.added[0].empirical);
  EXPECT_EQ(found.added[1].term.id, effect);
  EXPECT_FALSE(found.added[1].empirical);
  EXPECT_NEAR(found.added[1].term.parameters.front().value, value, 0.1 * value);
  EXPECT_EQ(found.added[1].term.parameters.front().low,
            found.explanations.front().effects.front().parameters.front().low)
      << "one interval in one answer";
  for (const auto& [path, moved] : found.recalibrated) EXPECT_FALSE(path.starts_with("effects.")) << path;
  EXPECT_EQ(found.improved.effects.size(), 2U);
}

// Beside a base whose barriers differ by polarity a lag does not explain enough; beside the correction it
// explains all, and the answer is that of the second asking alone.
TEST(Discrepancy, AnEffectIsNamedBesideACorrectionOfTheKinetics) {
  auto bench = real_bench();
  bench.effects.push_back({"empirical_asymmetry", {{"log_ratio", 0.08}}});
  bench.effects.push_back({"displacement_lag", {{"time_constant", 2e-3}}});
  const auto found =
      discover(given(), measure(bench), {.candidates = {"displacement_lag", "displacement_clipping"}});
  ASSERT_NO_FATAL_FAILURE(expect_named_beside(found, "empirical_asymmetry", "displacement_lag", 2e-3));
  EXPECT_NEAR(found.added[0].term.parameters.front().value, 0.08, 8e-3);
  EXPECT_TRUE(found.explanations.front().leave_one_out);
  EXPECT_TRUE(found.doubted.empty());
  EXPECT_GT(found.share_held_out, 0.95) << text_report(found);
}

// A spring that bends, which may not be named, and a drag that takes less than its share of the gap while
// that stands beside it. Beside the table that stands for the spring it takes nearly all that is left.
TEST(Discrepancy, AnEffectIsNamedBesideATable) {
  auto bench = real_bench();
  bench.effects.push_back({"spring_hardening", {{"coefficient", 4e3}}});
  bench.effects.push_back({"domain_wall_drag", {{"coefficient", 2e4}}});
  const auto found =
      discover(given(), measure(bench), {.candidates = {"domain_wall_drag", "displacement_clipping"}});
  ASSERT_NO_FATAL_FAILURE(expect_named_beside(found, "empirical_spring", "domain_wall_drag", 2e4));
  EXPECT_GT(found.added[1].share.value_or(0), 0.9);
  EXPECT_GT(found.added[1].share_held_out.value_or(0), 0.7);
  EXPECT_GT(found.share_held_out, 0.9) << text_report(found);
}

// The same beside a lag that takes nearly all of the gap and is named at once.
TEST(Discrepancy, ASecondEffectIsNamedBesideATableAndTheFirst) {
  auto bench = real_bench();
  bench.effects.push_back({"spring_hardening", {{"coefficient", 4e3}}});
  bench.effects.push_back({"domain_wall_drag", {{"coefficient", 2e4}}});
  bench.effects.push_back({"displacement_lag", {{"time_constant", 2e-2}}});
  const auto found =
      discover(given(), measure(bench),
               {.candidates = {"displacement_lag", "domain_wall_drag", "displacement_clipping"}});
  ASSERT_EQ(found.verdict, Verdict::named) << text_report(found);
  ASSERT_EQ(found.explanations.size(), 1U) << text_report(found);
  const auto& effects = found.explanations.front().effects;
  ASSERT_EQ(effects.size(), 2U) << text_report(found);
  ASSERT_EQ(found.added.size(), 3U) << text_report(found);
  EXPECT_EQ(found.added[0].term.id, "empirical_spring");
  const std::vector<std::pair<std::string, double>> hidden{{"displacement_lag", 2e-2},
                                                           {"domain_wall_drag", 2e4}};
  for (std::size_t i = 0; i < hidden.size(); ++i) {
    EXPECT_EQ(effects[i].id, hidden[i].first);
    EXPECT_EQ(found.added[i + 1].term.id, hidden[i].first);
    EXPECT_FALSE(found.added[i + 1].empirical);
    EXPECT_NEAR(effects[i].parameters.front().value, hidden[i].second, 0.1 * hidden[i].second);
  }
  EXPECT_GT(found.added[2].share.value_or(0), 0.9);
  EXPECT_GT(found.share_held_out, 0.9) << text_report(found);
  for (const auto& [path, moved] : found.recalibrated) EXPECT_FALSE(path.starts_with("effects.")) << path;
  EXPECT_EQ(found.improved.effects.size(), 3U);
}

// A smaller gap beside instruments that are a few percent off: what narrows it goes by noise, with what was
// recalibrated, and leaves no more in any channel, learned or locked, than stood before.
TEST(Discrepancy, NarrowingASmallGapKeepsTheInstruments) {
  auto bench = real_bench();
  bench.effects.push_back(foreign_kinetics(2e4));
  auto recordings = measure(bench);
  for (auto& [name, r] : recordings) {
    for (double& v : *r.channels[static_cast<std::size_t>(Channel::charge)]) v *= 1.03;
    for (double& v : *r.channels[static_cast<std::size_t>(Channel::displacement)]) v *= 0.97;
  }
  const auto found = discover(given(), recordings, {.candidates = {"displacement_clipping"}});
  ASSERT_EQ(found.verdict, Verdict::unknown) << text_report(found);
  ASSERT_FALSE(found.added.empty()) << text_report(found);
  EXPECT_GT(found.share_held_out, 0.9) << text_report(found);
  for (const auto* split : {&found.train, &found.held_out})
    for (const auto& [channel, before] : split->before)
      EXPECT_LT(split->after.at(channel), 1.05 * before) << text_report(found);
}

// Two channels of two rows; what was not measured does not count.
TEST(Discrepancy, AShareIsOfTheExcessAboveNoise) {
  using inference::share_explained;
  const inference::Signals before{{{3, -3}, {2, NAN}}}, after{{{1.5, -1.5}, {1, NAN}}}, noise{{{1, -1}}};
  EXPECT_DOUBLE_EQ(share_explained(before, after), 1 - (2 * 2.25 + 1 - 3) / (2 * 9 + 4 - 3.0));
  EXPECT_DOUBLE_EQ(share_explained(noise, noise), 0);
  EXPECT_DOUBLE_EQ(share_explained(after, before), 0);
  // A channel whose noise was counted too high does not hide what another one misses.
  const inference::Signals quiet{{{3, -3}, {0.1, 0.1, 0.1}}}, explained{{{1, -1}, {0.1, 0.1, 0.1}}};
  EXPECT_DOUBLE_EQ(share_explained(quiet, explained), 1);
  const std::vector<std::vector<inference::NoiseModel>> noise_of{{{.white = 1}, {.white = 1}}};
  EXPECT_DOUBLE_EQ(inference::excess_beside_error(noise_of, quiet, {0}), 2 * 9 - 2);
  EXPECT_DOUBLE_EQ(inference::excess_beside_error(noise_of, explained, {0}), 0);
}

// What a base model needs is too coarse for an explanation that spreads its domains widely.
TEST(Discrepancy, TheFineSimulationIsRefinedForAWideSpread) {
  auto spread = real_bench();
  spread.polycrystal.barrier_log_std = 0.7;
  std::vector<std::string> warnings;
  const auto bench = inference::prepare_bench(
      given(),
      {{plans()[0].name, record(spread, plans()[0], 1)}, {plans()[4].name, record(spread, plans()[4], 2)}},
      2000, warnings);
  const auto noises = inference::estimate_noise(bench, warnings);
  const auto domains_wanted = [&](const Model& model) {
    const auto hypothesis = inference::base_hypothesis(model, bench);
    const auto at = inference::prior_mean(hypothesis);
    const SimulationOptions begin{.tolerance = 1e-5, .domains = 1000, .shift = 7};
    inference::WhitenedRecordings fine(bench, noises, {0, 1}, begin, 2);
    const double stated = inference::converge_fine_fidelity(fine, hypothesis, at, 16000).error;
    const int domains = fine.simulation().domains;
    auto exact = begin;
    exact.domains = 60000;
    exact.shift = 5;
    const inference::WhitenedRecordings reference(bench, noises, {0, 1}, exact, 2);
    const Eigen::VectorXd off = fine.evaluate(hypothesis, at) - reference.evaluate(hypothesis, at);
    EXPECT_LT(off.squaredNorm(), 20) << domains;
    EXPECT_LT(std::sqrt(off.squaredNorm() / static_cast<double>(off.size())), 3 * stated + 1e-3);
    return domains;
  };
  EXPECT_GE(domains_wanted(spread), 2 * domains_wanted(real_bench()));
}

// Levels that were gone to at another pace than the recording's own, beside parameters that are off.
TEST(Discrepancy, UnknownPastsAreEstimatedBesideTheRecalibration) {
  using protocols::FirstState;
  using protocols::Past;
  using protocols::PastKind;
  const std::vector<Past> pasts{{PastKind::poled_minus},
                                {PastKind::visited, FirstState::poled_minus, {{1.1e6, 3}}},
                                {PastKind::unpoled},
                                {PastKind::poled_minus},
                                {PastKind::visited, FirstState::poled_plus, {{-8e5, 0.3}}}};
  std::vector<NamedRecording> recordings;
  for (std::size_t i = 0; i < plans().size(); ++i)
    recordings.push_back({plans()[i].name, record(real_bench(), plans()[i], 20 + i, &pasts[i])});
  const auto found = discover(given(), recordings);
  EXPECT_EQ(found.verdict, Verdict::nothing_missing) << text_report(found);
  for (const auto& [channel, left] : found.left) EXPECT_LT(left.over_noise, 1.05);
  for (std::size_t i = 0; i < pasts.size(); ++i) {
    EXPECT_TRUE(found.pasts[i].chosen);
    EXPECT_EQ(found.pasts[i].past.kind, pasts[i].kind) << protocols::in_words(found.pasts[i].past);
    EXPECT_EQ(found.pasts[i].past.from, pasts[i].from) << protocols::in_words(found.pasts[i].past);
  }
}

struct TwoRecordings {
  std::vector<inference::BenchRecording> bench;
  std::vector<std::vector<inference::NoiseModel>> noises;
};

TwoRecordings prepare_two(const NamedRecording& first, const NamedRecording& second) {
  std::vector<std::string> warnings;
  auto bench = inference::prepare_bench(given(), {first, second}, 2000, warnings);
  auto noises = inference::estimate_noise(bench, warnings);
  return {std::move(bench), std::move(noises)};
}

TwoRecordings two_recordings() {
  return prepare_two({plans()[0].name, record(real_bench(), plans()[0], 1)},
                     {plans()[4].name, record(real_bench(), plans()[4], 2)});
}

// One recording's past is wrong, then right, then wrong again.
TEST(Incumbent, KeepsOtherPastsOnlyWhereLessIsMissed) {
  using namespace inference;
  using protocols::Past;
  using protocols::PastKind;
  const Past plus{PastKind::poled_plus}, minus{PastKind::poled_minus};
  auto [bench, noises] = prepare_two({plans()[1].name, record(real_bench(), plans()[1], 1, &plus)},
                                     {plans()[4].name, record(real_bench(), plans()[4], 2, &minus)});
  std::vector<Past> next;
  ImprovementTask task;
  task.bench = &bench;
  task.noise = &noises;
  task.train = {0, 1};
  task.choose_pasts = [&](const Model&) { return next; };
  task.set_pasts = [&bench = bench](const std::vector<Past>& pasts) { hold_pasts(bench, pasts); };
  task.set_pasts({plus, plus});
  Fit base;
  base.hypothesis = base_hypothesis(given(), bench);
  base.z = prior_mean(base.hypothesis);
  Incumbent incumbent(task, base, [](const std::string&) {});
  incumbent.settle(1);
  next = {plus, minus};
  incumbent.refit_under_other_pasts();
  EXPECT_EQ(incumbent.pasts(), next);
  const Eigen::VectorXd z = incumbent.at().z;
  next = {plus, plus};
  incumbent.refit_under_other_pasts();
  EXPECT_EQ(incumbent.pasts(), (std::vector<Past>{plus, minus}));
  EXPECT_EQ(incumbent.at().z, z);
}

// `z` with barriers wider by 2.6: eight standard deviations of the prior.
Eigen::VectorXd widely_spread(const inference::Hypothesis& hypothesis, Eigen::VectorXd z) {
  for (std::size_t i = 0; i < hypothesis.parameters.size(); ++i)
    if (hypothesis.parameters[i].path == "polycrystal.barrier_log_std") z[static_cast<Eigen::Index>(i)] += 8;
  return z;
}

// A few nodes give what many give at the anchor, nearly so around it, and far away the anchor is moved.
TEST(Discrepancy, AnAnchorTakesOutMostOfTheErrorOfFewNodes) {
  const auto two = two_recordings();
  const auto& bench = two.bench;
  const auto& noises = two.noises;
  const auto hypothesis = inference::base_hypothesis(given(), bench);
  const auto at = inference::prior_mean(hypothesis);
  const SimulationOptions few{.tolerance = 1e-5, .domains = 250, .shift = 7},
      many{.tolerance = 1e-5, .domains = 8000, .shift = 7},
      exact{.tolerance = 1e-5, .domains = 60000, .shift = 5};
  const inference::WhitenedRecordings reference(bench, noises, {0, 1}, exact, 2),
      plain(bench, noises, {0, 1}, few, 2);
  inference::WhitenedRecordings fine(bench, noises, {0, 1}, many, 2);
  const auto there = fine.evaluate(hypothesis, at);
  fine.anchor(hypothesis, at, there);
  fine.simulate_by(few);
  EXPECT_LT((fine.evaluate(hypothesis, at) - there).norm(), 1e-9 * there.norm());
  const Eigen::VectorXd near = at.array() + 0.1;
  const auto truth = reference.evaluate(hypothesis, near);
  const double left = (fine.evaluate(hypothesis, near) - truth).squaredNorm(),
               without = (plain.evaluate(hypothesis, near) - truth).squaredNorm();
  EXPECT_LT(left, 0.1 * without) << without;

  const auto far = widely_spread(hypothesis, at);
  const auto converged = inference::converge_fine_fidelity(fine, hypothesis, far, 16000);
  EXPECT_LT((converged.residual - reference.evaluate(hypothesis, far)).squaredNorm(), 20);
  EXPECT_TRUE(fine.is_anchored());
  EXPECT_LT((fine.evaluate(hypothesis, far) - converged.residual).norm(), 1e-9 * converged.residual.norm());
  fine.release();
  EXPECT_GE(fine.simulation().domains, many.domains);
}

// The steps of few nodes end where their grain does; those of the fine simulation where it has nothing to
// gain.
TEST(Discrepancy, TheLastStepsOfABaseAreThoseOfTheFineSimulation) {
  const auto two = two_recordings();
  const auto hypothesis = inference::base_hypothesis(given(), two.bench);
  const SimulationOptions few{.tolerance = 1e-4, .domains = 150, .shift = 7},
      many{.tolerance = 1e-5, .domains = 2000, .shift = 7};
  const auto gain_left = [&](inference::LastSteps by) {
    const inference::WhitenedRecordings coarse(two.bench, two.noises, {0, 1}, few, 2);
    inference::WhitenedRecordings fine(two.bench, two.noises, {0, 1}, many, 2);
    fine.make_last_steps_by(few);
    auto fit = inference::minimize(coarse, hypothesis, inference::prior_mean(hypothesis), {.tick = {}});
    inference::apply_fidelity_correction(coarse, fine, fit);
    inference::refine(coarse, fine, fit, by, {});
    EXPECT_EQ(fine.simulation().domains, many.domains);
    return inference::minimize(fine, hypothesis, fit.z, {.iterations = 0, .tick = {}}).predicted_decrease();
  };
  const double cheap = gain_left(inference::LastSteps::cheap),
               by_fine = gain_left(inference::LastSteps::fine);
  EXPECT_LT(by_fine, 1);
  EXPECT_LT(by_fine, 0.5 * cheap);
}

// Far from its anchor the fine simulation is off by more than what counts as a detection.
TEST(Discrepancy, ABaseIsAnchoredWhereItEnds) {
  const auto two = two_recordings();
  const auto hypothesis = inference::base_hypothesis(given(), two.bench);
  const inference::WhitenedRecordings coarse(two.bench, two.noises, {0, 1},
                                             {.tolerance = 1e-3, .domains = 25, .shift = 7}, 2);
  inference::WhitenedRecordings fine(two.bench, two.noises, {0, 1},
                                     {.tolerance = 1e-5, .domains = 4000, .shift = 7}, 2);
  fine.make_last_steps_by(coarse.simulation());
  const auto base = inference::fit_base(
      coarse, fine, hypothesis,
      {.start = widely_spread(hypothesis, inference::prior_mean(hypothesis)), .tick = [](auto&&...) {}});
  EXPECT_TRUE(fine.is_anchored());
  fine.release();
  const double exact =
      inference::minimize(fine, hypothesis, base.fit.z, {.iterations = 0, .tick = {}}).squares;
  EXPECT_NEAR(base.fit.squares, exact, inference::unnoticed_change);
}

// Steps by a coarse simulation, corrected where each solution ends, lead to the minimum of the fine one, but
// for the grain of the coarse sum, at which a solution stands still: by 250 domains that is up to 30, by 500
// less than what a verdict notices.
TEST(Discrepancy, ACorrectedFitEndsAtTheMinimumOfTheFineSimulation) {
  const auto two = two_recordings();
  const auto hypothesis = inference::base_hypothesis(given(), two.bench);
  const auto start = widely_spread(hypothesis, inference::prior_mean(hypothesis));
  const inference::WhitenedRecordings fine(two.bench, two.noises, {0, 1},
                                           {.tolerance = 1e-5, .domains = 4000, .shift = 7}, 2);
  const inference::SolverOptions options{.iterations = 30, .tick = {}};
  const auto by_fine = [&](const Eigen::VectorXd& from, const inference::SolverOptions& how) {
    return inference::minimize(fine, hypothesis, from, how).squares;
  };
  const double of_fine = by_fine(start, options);
  for (const auto& [domains, grain] : {std::pair{250, 30.0}, {500, inference::unnoticed_change}}) {
    const inference::WhitenedRecordings coarse(two.bench, two.noises, {0, 1},
                                               {.tolerance = 1e-4, .domains = domains, .shift = 7}, 2);
    const auto of_coarse = inference::minimize(coarse, hypothesis, start, options);
    inference::Fit fit;
    fit.hypothesis = hypothesis;
    fit.z = start;
    inference::minimize_corrected(coarse, fine, fit, options);
    EXPECT_LT(fit.squares, of_fine + inference::unnoticed_change) << domains;
    EXPECT_LT(fit.squares, by_fine(fit.z, options) + grain) << domains;
    EXPECT_GT(by_fine(of_coarse.z, {.iterations = 0, .tick = {}}), fit.squares + inference::unnoticed_change)
        << domains;
  }
}

// What is fitted must not be the grain of the coarse simulation's own sum.
TEST(Discrepancy, TheCoarseSimulationIsFineEnoughWhereTheModelStands) {
  const auto two = two_recordings();
  const auto& bench = two.bench;
  const auto& noises = two.noises;
  const auto hypothesis = inference::base_hypothesis(given(), bench);
  const auto given_place = inference::prior_mean(hypothesis);
  const auto moved = widely_spread(hypothesis, given_place);
  const SimulationOptions begin{.tolerance = 1e-5, .domains = 1000, .shift = 7},
      exact{.tolerance = 1e-5, .domains = 60000, .shift = 5};
  const inference::WhitenedRecordings reference(bench, noises, {0, 1}, exact, 2);
  const auto chosen_at = [&](const Eigen::VectorXd& z, const inference::AllowedError& allowed) {
    inference::WhitenedRecordings coarse(bench, noises, {0, 1}, begin, 2),
        fine(bench, noises, {0, 1}, begin, 2);
    inference::choose_fidelities(coarse, fine, hypothesis, z, 16000, allowed);
    const auto off = [&](const inference::WhitenedRecordings& by) {
      return inference::coarse_error_at(coarse, by.evaluate(hypothesis, z), hypothesis, z);
    };
    EXPECT_LT(off(fine), allowed.coarse);
    EXPECT_LT(off(reference), 1.2 * allowed.coarse);
    const int domains = coarse.simulation().domains;
    coarse.simulate_by(fine.last_steps());
    EXPECT_LT(off(fine), std::min(allowed.coarse, inference::last_steps_error));
    return domains;
  };
  const int few = chosen_at(given_place, inference::if_corrected);
  EXPECT_GT(chosen_at(moved, inference::beside_model_error), few);
  EXPECT_GT(chosen_at(moved, {.coarse = 0.2}), few);  // stricter than any fit asks

  const auto fine_domains = [&](double allowed) {
    inference::WhitenedRecordings fine(bench, noises, {0, 1}, begin, 2);
    const auto [residual, error] = inference::converge_fine_fidelity(fine, hypothesis, moved, 16000, allowed);
    EXPECT_LT(error, std::max(allowed, std::sqrt(inference::unnoticed_change / fine.samples())));
    const Eigen::VectorXd off = residual - reference.evaluate(hypothesis, moved);
    EXPECT_LT(std::sqrt(off.squaredNorm() / fine.samples()), 2 * error) << allowed;
    return fine.simulation().domains;
  };
  EXPECT_LT(fine_domains(inference::beside_model_error.fine), fine_domains(0));
}

TEST(Discrepancy, AMeasuredDriveIsUncertain) {
  auto recordings = measure(real_bench());
  for (auto& [name, r] : recordings) {
    r.channels[static_cast<std::size_t>(Channel::command)].reset();
    for (double& e : *r.channels[static_cast<std::size_t>(Channel::field)]) e = 1.01 * e + 2e4;
  }
  const auto found = discover(given(), recordings);
  EXPECT_EQ(found.verdict, Verdict::nothing_missing) << text_report(found);
  EXPECT_NEAR(found.recalibrated.at("offset.field").to, 2e4, 4 * found.recalibrated.at("offset.field").std);
}

// The channels know better than a noisy field where its corners were.
TEST(Discrepancy, AMeasuredDriveIsSettledByTheChannels) {
  const auto& plan = plans().back();
  auto r = record(real_bench(), plan, 1);
  std::mt19937_64 random(2);
  std::normal_distribution<double> noise(0, 3e4);
  r.channels[static_cast<std::size_t>(Channel::command)].reset();
  for (double& e : *r.channels[static_cast<std::size_t>(Channel::field)]) e += noise(random);
  std::vector<std::string> warnings;
  const auto bench = inference::prepare_bench(given(), {{plan.name, r}}, 2000, warnings);
  const auto noises = inference::estimate_noise(bench, warnings);
  const inference::WhitenedRecordings coarse(bench, noises, {0}, {.tolerance = 1e-5, .domains = 1500}, 1);
  const auto truth = inference::base_hypothesis(real_bench(), bench);
  const auto at = inference::prior_mean(truth);
  const auto before = coarse.simulated(truth, at, 0);
  const Eigen::VectorXd as_read = Eigen::VectorXd::Zero(bench[0].knot_error.cols());
  const auto settled =
      bench[0].with_knots_moved(bench[0].knot_error * coarse.posterior_drive(truth, at, 0, as_read, before));
  const auto after = coarse.simulated(truth, at, 0, &settled);
  const auto squares = [&](const std::vector<std::vector<double>>& simulated) {
    double sum = 0, count = 0;
    for (std::size_t c = 0; c < simulated.size(); ++c)
      for (const double e : coarse.plain_residual(0, c, simulated[c])) {
        sum += e * e;
        ++count;
      }
    return sum / count;
  };
  EXPECT_GT(squares(before), 1.3);
  EXPECT_NEAR(squares(after), 1, 0.1);
  const auto command = record(real_bench(), plan, 1).at(Channel::command);
  const auto off = [&](const inference::BenchRecording& drive) {
    double sum = 0;
    std::size_t k = 1;
    for (std::size_t i = 0; i < command.size(); ++i) {
      while (k + 1 < drive.knot_time.size() && r.time[i] > drive.knot_time[k]) ++k;
      const double u = (r.time[i] - drive.knot_time[k - 1]) / (drive.knot_time[k] - drive.knot_time[k - 1]);
      sum += std::pow(std::lerp(drive.knot_field[k - 1], drive.knot_field[k], u) - command[i], 2);
    }
    return sum;
  };
  EXPECT_LT(off(settled), 0.5 * off(bench[0]));
}

// However far the drive is off, a prediction under the posterior drive does no worse than one under the drive
// as read.
TEST(Discrepancy, APredictionUnderAPosteriorDriveDoesNoWorse) {
  const auto& plan = plans().back();
  for (const double level : {3e4, 1e5, 3e5}) {
    auto r = record(real_bench(), plan, 1);
    std::mt19937_64 random(2);
    std::normal_distribution<double> noise(0, level);
    r.channels[static_cast<std::size_t>(Channel::command)].reset();
    for (double& e : *r.channels[static_cast<std::size_t>(Channel::field)]) e += noise(random);
    std::vector<std::string> warnings;
    const auto bench = inference::prepare_bench(given(), {{plan.name, r}}, 2000, warnings);
    const auto noises = inference::estimate_noise(bench, warnings);
    const inference::WhitenedRecordings coarse(bench, noises, {0}, {.tolerance = 1e-4, .domains = 250}, 1),
        fine(bench, noises, {0}, {.tolerance = 1e-5, .domains = 2000}, 1);
    const auto truth = inference::base_hypothesis(real_bench(), bench);
    const auto at = inference::prior_mean(truth);
    const auto as_read = inference::rms_by_channel(fine, inference::predict(fine, truth, at).standardized);
    const auto settled =
        inference::rms_by_channel(fine, inference::predict(fine, coarse, truth, at).standardized);
    for (const auto& [channel, rms] : settled) {
      EXPECT_LE(rms, as_read.at(channel)) << level << recordings::channel_name(channel);
      if (level <= 1e5) {
        EXPECT_LT(rms, 1.2) << level << recordings::channel_name(channel);
      }
    }
  }
}

// Noise with a memory moves the knots further than white noise of its level would, and they say so.
TEST(Discrepancy, AMeasuredDriveIsAsUncertainAsItsNoiseHasMemory) {
  const auto off_over_stated = [](double memory) {
    const std::vector<std::pair<int, double>> corners{{0, 0},       {150, 1e6},    {500, 1e6}, {700, -8e5},
                                                      {1100, -8e5}, {1300, 1.5e6}, {1600, 0}};
    std::normal_distribution<double> normal;
    double squares = 0, count = 0;
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      std::mt19937_64 random(seed);
      recordings::Recording r;
      std::vector<double> field;
      double slow = normal(random);
      std::size_t leg = 0;
      for (int i = 0; i <= corners.back().first; ++i) {
        while (leg + 2 < corners.size() && i > corners[leg + 1].first) ++leg;
        const auto [begin, from] = corners[leg];
        const auto [end, to] = corners[leg + 1];
        slow = memory * slow + std::sqrt(1 - memory * memory) * normal(random);
        r.time.push_back(0.01 * i);
        field.push_back(std::lerp(from, to, static_cast<double>(i - begin) / (end - begin)) +
                        3e3 * (memory > 0 ? std::sqrt(0.5) * (slow + normal(random)) : normal(random)));
      }
      const auto m = given();
      r.header.specimen = {m.name, m.actuator.length, m.actuator.area, m.actuator.layer_thickness,
                           m.actuator.layer_count};
      r.set(Channel::charge) = simulate(m, r.time, field).charge;
      r.set(Channel::field) = field;
      std::vector<std::string> warnings;
      const auto drive = inference::prepare_bench(m, {{"noisy", r}}, 2000, warnings).front();
      const Eigen::VectorXd stated = drive.knot_error.rowwise().norm();
      const auto levels = static_cast<Eigen::Index>(drive.level_of.back() + 1);
      for (std::size_t k = 1; k + 1 < drive.knot_time.size(); ++k)
        for (const auto& [sample, level] : corners) {
          if (std::abs(drive.knot_time[k] - 0.01 * sample) > 0.02) continue;
          squares += std::pow(
              (drive.knot_field[k] - level) / stated[static_cast<Eigen::Index>(drive.level_of[k])], 2);
          squares += std::pow(
              (drive.knot_time[k] - 0.01 * sample) / stated[levels + static_cast<Eigen::Index>(k) - 1], 2);
          count += 2;
        }
    }
    EXPECT_GE(count, 90);  // five inner corners, nearly all found
    return squares / count;
  };
  for (const double memory : {0.0, 0.7, 0.9}) {
    const double off = off_over_stated(memory);
    EXPECT_GT(off, 0.5) << memory;
    EXPECT_LT(off, 1.7) << memory;
  }
}

// A charge amplifier that leaks is what is left most of, by noise; of what the force leaves it is no reason.
TEST(Discrepancy, WhatAChannelLeavesIsOfAFamilyThatActsThere) {
  auto leaking = given();
  leaking.effects.push_back({"charge_amplifier_decay", {{"time_constant", 20}}});
  const auto recordings = measure(leaking);
  std::vector<std::string> warnings;
  const auto bench = inference::prepare_bench(given(), {recordings[0], recordings[2]}, 2000, warnings);
  const inference::WhitenedRecordings residuals(bench, inference::estimate_noise(bench, warnings), {0, 1},
                                                {.tolerance = 1e-4, .domains = 500}, 2);
  const auto hypothesis = inference::base_hypothesis(given(), bench);
  auto fit = inference::minimize(residuals, hypothesis, inference::prior_mean(hypothesis),
                                 {.iterations = 1, .tick = {}});
  inference::refresh_jacobian(residuals, fit);
  EXPECT_EQ(inference::fit_residual_basis(residuals, fit).family, Family::charge_sensor);
  EXPECT_THAT(inference::fit_residual_basis(residuals, fit, Channel::force).family,
              testing::AnyOf(Family::force_sensor, Family::strain, Family::equilibrium, Family::kinetics));
}

// A base model that is fitted, by so many steps, to two recordings of a bench.
struct BegunBase {
  BegunBase(const Model& measured_on, int iterations)
      : two(prepared(measured_on)),
        coarse(two.bench, two.noises, {0, 1}, simulation, 2),
        fine(two.bench, two.noises, {0, 1}, simulation, 2) {
    const auto hypothesis = inference::base_hypothesis(given(), two.bench);
    base = inference::minimize(coarse, hypothesis, inference::prior_mean(hypothesis),
                               {.iterations = iterations, .tick = {}});
    inference::apply_fidelity_correction(coarse, fine, base);
    inference::refresh_jacobian(coarse, base);
  }
  inference::ForwardSelection select(const inference::Fit& from, const inference::SelectionTask& task) {
    return inference::select_forward(coarse, fine, from, task, {});
  }

  TwoRecordings two;
  inference::WhitenedRecordings coarse, fine;
  inference::Fit base;

 private:
  static constexpr SimulationOptions simulation{.tolerance = 1e-5, .domains = 1000, .shift = 7};
  static TwoRecordings prepared(const Model& measured_on) {
    const auto recordings = measure(measured_on);
    return prepare_two(recordings[0], recordings[2]);
  }
};

// A base model that noise rejects by far is not taken to the end of the fine simulation, but stands where
// that simulation is anchored.
TEST(Discrepancy, ARejectedBaseIsNotTakenToItsEnd) {
  const auto two = two_recordings();
  const auto hypothesis = inference::base_hypothesis(given(), two.bench);
  const inference::WhitenedRecordings coarse(two.bench, two.noises, {0, 1},
                                             {.tolerance = 1e-3, .domains = 250, .shift = 7}, 2);
  const auto recalibrated = [&](double rejected) {
    inference::WhitenedRecordings fine(two.bench, two.noises, {0, 1},
                                       {.tolerance = 1e-5, .domains = 4000, .shift = 7}, 2);
    fine.make_last_steps_by(coarse.simulation());
    auto base =
        inference::fit_base(coarse, fine, hypothesis, {.rejected = rejected, .tick = [](auto&&...) {}});
    EXPECT_TRUE(fine.is_anchored());
    EXPECT_NEAR(inference::minimize(fine, hypothesis, base.fit.z, {.iterations = 0, .tick = {}}).squares,
                base.fit.squares, inference::unnoticed_change);
    return base;
  };
  const auto begun = recalibrated(0), ended = recalibrated(1e12);
  EXPECT_FALSE(begun.is_final);
  EXPECT_TRUE(ended.is_final);
  EXPECT_LT(ended.fit.squares, begun.fit.squares);
  EXPECT_LT(begun.fit.squares - ended.fit.squares,
            inference::SelectionOptions().unfinished_base * inference::SelectionOptions().detection);
}

// Unless what it may still gain decides whether there is an effect at all.
TEST(Discrepancy, WhatABaseMayStillGainDecidesOnlyBesideAWeakEffect) {
  auto with_effect = real_bench();
  with_effect.effects.push_back({"charge_offset_current", {{"current", 6e-6}}});
  for (const auto& measured_on : {real_bench(), with_effect}) {
    const bool has_effect = measured_on.effects.size() > real_bench().effects.size();
    BegunBase begun(measured_on, 8);
    inference::SelectionTask task{.candidates = {&find_effect("charge_offset_current")},
                                  .most_domains = 1000,
                                  .base_is_final = false,
                                  .beyond_effects = {},
                                  .tick = {}};
    const auto forward = begun.select(begun.base, task);
    EXPECT_EQ(forward.base_decides, !has_effect);
    EXPECT_EQ(forward.detected, has_effect);
    task.base_is_final = true;
    EXPECT_EQ(begun.select(begun.base, task).detected, has_effect);
  }
}

// A drag on domain walls and a source resistance differ by what the reversible response does alone. Beside
// another effect they are told apart by fits that have both come to their ends.
TEST(Discrepancy, RivalsBesideAnotherEffectAreComparedAtTheirEnds) {
  auto bench = real_bench();
  bench.effects.push_back({"electrostriction", {{"coefficient", 3e-17}}});
  bench.effects.push_back({"domain_wall_drag", {{"coefficient", 3e4}}});
  BegunBase begun(bench, 8);
  const auto& drag = find_effect("domain_wall_drag");
  const auto& resistance = find_effect("source_resistance");
  const auto forward =
      begun.select(begun.base, {.candidates = {&find_effect("electrostriction"), &drag, &resistance},
                                .most_domains = 1000,
                                .beyond_effects = {},
                                .tick = {}});
  std::set<const Effect*> compared;
  for (const auto& t : forward.trials)
    if (t.effects.size() == 2 && t.polished) compared.insert(t.effects[1]);
  EXPECT_THAT(compared, testing::UnorderedElementsAre(&drag, &resistance));
}

// A base fit that has not arrived: what an effect seems to explain, the base does from where that led.
TEST(Discrepancy, TheBaseIsTriedFromWhereAnEffectLed) {
  BegunBase begun(real_bench(), 1);
  inference::SelectionTask task{.candidates = {&find_effect("displacement_drift")},
                                .most_domains = 1000,
                                .beyond_effects = {},
                                .tick = {}};
  EXPECT_FALSE(begun.select(begun.base, task).better_base);
  task.doubt_base = true;
  const auto forward = begun.select(begun.base, task);
  ASSERT_TRUE(forward.better_base);
  EXPECT_LT(forward.better_base->squares, begun.base.squares - 12);
  // From there, there is nothing to name.
  EXPECT_FALSE(begun.select(*forward.better_base, task).detected);
}

// Steps that a double holds exactly: the estimate of the noise is zero.
TEST(Discrepancy, AMeasuredDriveMayBeExact) {
  recordings::Recording r;
  std::vector<double> field;
  for (int i = 0; i <= 800; ++i) {
    r.time.push_back(i / 128.0);
    field.push_back(8192.0 * (i <= 200 ? i : i <= 600 ? 400 - i : i - 800));
  }
  const auto m = given();
  r.header.specimen = {m.name, m.actuator.length, m.actuator.area, m.actuator.layer_thickness,
                       m.actuator.layer_count};
  r.set(Channel::charge) = simulate(m, r.time, field).charge;
  r.set(Channel::field) = field;
  std::vector<std::string> warnings;
  const auto drive = inference::prepare_bench(m, {{"exact", r}}, 2000, warnings).front();
  ASSERT_EQ(drive.knot_field.size(), 4U);
  EXPECT_NEAR(drive.knot_field[1], 8192 * 200, 1);
  EXPECT_NEAR(drive.knot_field[2], -8192 * 200, 1);
  EXPECT_NEAR(drive.knot_time[1], 200 / 128.0, 1e-6);
  EXPECT_TRUE(drive.knot_error.allFinite());
}

TEST(Discrepancy, MovedParametersAreNoEffect) {
  const auto found = discover(given(), measure(real_bench()));
  EXPECT_EQ(found.verdict, Verdict::nothing_missing) << text_report(found);
  EXPECT_TRUE(found.explanations.empty());
  // The recalibration found its way to the bench, as near as it says, also where only what is known
  // beforehand holds a parameter or a gain.
  double before = 0, after = 0;
  for (const auto& [path, r] : found.recalibrated) {
    const bool of_model = path.starts_with("material.") || path.starts_with("polycrystal.");
    const double truth = of_model ? get_parameter(real_bench(), path) : 1;
    EXPECT_LT(std::abs(r.to - truth), 4 * r.std) << path << ' ' << r.to << ' ' << truth << ' ' << r.std;
    if (!of_model) continue;
    before += std::abs(std::log(r.from / truth));
    after += std::abs(std::log(r.to / truth));
    EXPECT_GT(r.std, 0) << path;
  }
  EXPECT_LT(after, 0.6 * before);
  EXPECT_GT(found.smallest_detectable.size(), 20U);
}

TEST(Discrepancy, OneRecordingWithoutCommandAndForce) {
  auto bench = real_bench();
  bench.effects.push_back({"displacement_lag", {{"time_constant", 0.02}}});
  auto one = measure(bench);
  one.resize(2);
  one.erase(one.begin());
  auto& r = one.front().recording;
  r.channels[static_cast<std::size_t>(Channel::command)].reset();
  r.channels[static_cast<std::size_t>(Channel::force)].reset();
  auto gaps = r.at(Channel::displacement);
  for (std::size_t i = 100; i < 130; ++i) gaps[i] = NAN;
  r.set(Channel::displacement) = gaps;
  const auto found = discover(given(), one);
  EXPECT_TRUE(found.held_out.recordings.empty());
  EXPECT_NE(found.verdict, Verdict::nothing_missing) << text_report(found);
  EXPECT_THAT(text_report(found), HasSubstr("too few recordings"));
}

TEST(Discrepancy, AMillionSamplesOfASineAreThinned) {
  const auto m = real_bench();
  std::vector<double> coarse_time, coarse;
  for (int i = 0; i <= 2000; ++i) {
    coarse_time.push_back(0.01 * i);
    coarse.push_back(2e6 * std::sin(0.6 * coarse_time.back()));
  }
  const auto t = simulate(m, coarse_time, coarse, {.tolerance = 1e-4, .domains = 500, .shift = 5});
  recordings::Recording r;
  r.header.specimen = {m.name, m.actuator.length, m.actuator.area, m.actuator.layer_thickness,
                       m.actuator.layer_count};
  r.header.load = {m.load.spring_stiffness, m.load.prestress};
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  constexpr std::size_t fine = 500;
  for (std::size_t i = 0; i < 2000 * fine; ++i)
    r.time.push_back(0.01 * static_cast<double>(i) / static_cast<double>(fine));
  const auto refine = [&](Channel channel, const std::vector<double>& values, double noise) {
    auto& out = r.set(channel);
    for (std::size_t i = 0; i < r.time.size(); ++i) {
      const std::size_t k = i / fine;
      const double u = static_cast<double>(i % fine) / static_cast<double>(fine);
      out.push_back(values[k] + u * (values[k + 1] - values[k]) + noise * normal(random));
    }
  };
  refine(Channel::command, coarse, 0);
  refine(Channel::displacement, t.displacement, 2e-7);
  const auto found = discover(given(), {{"sine", r}});
  EXPECT_THAT(text_report(found), HasSubstr("of 1000000 samples took part"));
  EXPECT_LT(found.train.before.at(Channel::displacement), 1.3) << text_report(found);
}

std::string refusal(std::vector<NamedRecording> recordings, const DiscoverOptions& options = {}) {
  try {
    discover(given(), std::move(recordings), options);
  } catch (const Error& e) {
    return e.what();
  }
  return "";
}

std::vector<NamedRecording> scaled(Channel channel, double by) {
  auto all = measure(given());
  for (auto& [name, r] : all) {
    auto values = r.at(channel);
    for (double& v : values) v *= by;
    r.set(channel) = values;
  }
  return all;
}

TEST(Discrepancy, ImpossibleDataAreRefusedByName) {
  DiscoverOptions options, misspelt;
  options.held_out = {"no-such"};
  misspelt.candidates = {"electrostricton"};
  EXPECT_THAT(refusal({}), HasSubstr("no recording"));
  EXPECT_THAT(refusal(scaled(Channel::displacement, -1)), HasSubstr("sign"));
  EXPECT_THAT(refusal(scaled(Channel::displacement, 1e3)), HasSubstr("units"));
  EXPECT_THAT(refusal(scaled(Channel::charge, 1e-3)), HasSubstr("units"));
  EXPECT_THAT(refusal(scaled(Channel::displacement, 1e250)), HasSubstr("nothing measures"));
  EXPECT_THAT(refusal(measure(given()), options), HasSubstr("cannot be held out"));
  EXPECT_THAT(refusal(measure(given()), misspelt), HasSubstr("electrostriction"));
  auto stuck = measure(given());
  stuck[1].recording.time[40] = stuck[1].recording.time[39];
  EXPECT_THAT(refusal(stuck), HasSubstr("fast"));
}

TEST(Discrepancy, AFloorIsAShare) {
  DiscoverOptions options;
  for (const double floor : {0.0, 20.0, std::nan("")}) {
    options.floor = floor;
    EXPECT_THAT(refusal({}, options), HasSubstr("floor"));
  }
}

TEST(Discrepancy, StopsWhenAsked) {
  int calls = 0;
  DiscoverOptions options;
  options.progress = [&](const DiscoverProgress&) { return ++calls < 5; };
  EXPECT_THAT(refusal(measure(given()), options), HasSubstr("stopped"));
  EXPECT_EQ(calls, 5);
}

TEST(Whitening, MakesCorrelatedNoiseWhite) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  const inference::NoiseModel noise{.white = 0.7, .slow = 1.1, .correlation_time = 0.05};
  std::vector<double> times, values;
  double slow = noise.slow * normal(random);
  for (int i = 0; i < 20000; ++i) {
    const double dt = i % 3 == 0 ? 0.004 : 0.01, a = std::exp(-dt / noise.correlation_time);
    times.push_back(i == 0 ? 0 : times.back() + dt);
    if (i > 0) slow = a * slow + noise.slow * std::sqrt(1 - a * a) * normal(random);
    values.push_back(slow + noise.white * normal(random));
  }
  inference::Whitening(noise, times).apply(values);
  double square = 0, next = 0;
  for (std::size_t i = 1; i < values.size(); ++i) {
    square += values[i] * values[i];
    next += values[i] * values[i - 1];
  }
  EXPECT_NEAR(square / 20000, 1, 0.04);
  EXPECT_NEAR(next / square, 0, 0.03);
}

double squares(const ChannelFigures& figures) {
  double sum = 0;
  for (const auto& [channel, value] : figures) sum += value * value;
  return sum;
}

// The source's own measurements for a bench: what a single crystal lacks is a spread over the domains.
TEST(DiscrepancyInTables, ASingleCrystalLacksASpread) {
  const auto found = discover_in_tables(library_model("nec-single-crystal"), {"3.11", "3.12"});
  ASSERT_TRUE(found.verdict == Verdict::named || found.verdict == Verdict::ambiguous) << text_report(found);
  const auto& id = found.explanations.front().effects.front().id;
  EXPECT_TRUE(id == "barrier_distribution" || id == "interaction_field_distribution") << text_report(found);
  EXPECT_EQ(found.held_out.recordings, std::vector<std::string>{"8 MPa"});
  EXPECT_LT(squares(found.train.after), 0.2 * squares(found.train.before));
  EXPECT_LT(squares(found.held_out.after), 0.2 * squares(found.held_out.before));
  ASSERT_EQ(found.cells.size(), 36U);
  // The improved model gives the cells that the report says.
  const auto cells = simulate_table(found.improved, "3.11", {}).cells;
  for (std::size_t i = 0; i < cells.size(); ++i)
    if (found.cells[i].after > 0.1 * found.cells[i].published.published) {
      EXPECT_NEAR(cells[i].measured.value(), found.cells[i].after, 0.02 * found.cells[i].after) << i;
    }
}

TEST(DiscrepancyInTables, ALinearStageLacksRate) {
  const auto found = discover_in_tables(library_model("mcl-op30-linear"), {"3.13"});
  ASSERT_TRUE(found.verdict == Verdict::named || found.verdict == Verdict::ambiguous) << text_report(found);
  // What is added is of a plausible size, and its interval does not hold nothing.
  for (const auto& effect : found.explanations.front().effects) {
    const auto& size = find_effect(effect.id).parameters.front();
    const auto& p = effect.parameters.front();
    EXPECT_GE(std::abs(p.value), size.low) << text_report(found);
    EXPECT_LE(std::abs(p.value), size.high) << text_report(found);
    EXPECT_GT(p.low * p.high, 0) << text_report(found);
  }
  EXPECT_TRUE(found.held_out.recordings.empty());  // four cells are too few to lock one away
  EXPECT_LT(squares(found.train.after), 0.2 * squares(found.train.before));
  const auto strokes = simulate_table(found.improved, "3.13", {}).cells;
  EXPECT_GT(strokes.front().measured.value(), 1.03 * strokes.back().measured.value());
}

TEST(DiscrepancyInTables, RefusesWhatIsNotThere) {
  const auto model = library_model("mcl-op30");
  EXPECT_THROW(discover_in_tables(model, {"3.14"}), Error);
  EXPECT_THROW(discover_in_tables(model, {}), Error);
  EXPECT_THROW(discover_in_tables(model, {"3.13"}, {.held_out = {"7 V/s"}, .candidates = {}, .progress = {}}),
               Error);
}

}  // namespace
}  // namespace ferrobench::model
