// What is added to a model must be plausible and more than nothing, however well it fits.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "model/inference/parameters/scaled_parameters.h"
#include "model/inference/report/discovery_report.h"
#include "model/inference/selection/verdict.h"

namespace ferrobench::model::inference {
namespace {

constexpr double samples = 100;

const SelectionOptions options{};

// An effect at these values of its parameters, each known to this share of itself (one standard deviation),
// that explains all there is.
Trial trial(std::string_view id, const std::vector<double>& values, double known_to) {
  const auto& effect = find_effect(id);
  Trial out;
  out.effects = {&effect};
  auto& f = out.fit;
  f.hypothesis = with_effect({.model = library_model("soft-pzt"), .parameters = {}}, effect, values);
  const auto n = static_cast<Eigen::Index>(values.size());
  f.z = Eigen::VectorXd::Zero(n);
  f.residual = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(samples));
  f.jacobian = Eigen::MatrixXd::Zero(f.residual.size(), n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto& c = f.hypothesis.parameters[static_cast<std::size_t>(k)];
    // Standard deviations are widened as the likelihood is tempered.
    f.jacobian(k, k) = std::abs(c.slope(0) / c.value(0)) / known_to * std::sqrt(options.likelihood_tempering);
  }
  out.drop = 1000;
  out.checked = true;
  return out;
}

ModelSelection judged(const ForwardSelection& forward) {
  return select_model(forward, options, samples);
}
ForwardSelection one(Trial t) {
  ForwardSelection out;
  out.detected = true;
  out.trials.push_back(std::move(t));
  return out;
}

TEST(Verdict, NamesWhatIsPlausible) {
  const auto forward = one(trial("prestress_relaxation", {0.2, 10}, 0.1));
  const auto found = judged(forward);
  EXPECT_EQ(found.verdict, Verdict::named);
  EXPECT_EQ(found.doubted, nullptr);
  const auto fraction = effect_estimates(forward.trials[0], options)[0].parameters[0];
  EXPECT_NEAR(fraction.low, 0.2 * (1 - 0.1645), 1e-3);
  EXPECT_NEAR(fraction.high, 0.2 * (1 + 0.1645), 1e-3);
  // The range has one digit, and a size either sign where that has a meaning.
  EXPECT_EQ(judged(one(trial("prestress_relaxation", {0.52, 10}, 0.1))).verdict, Verdict::named);
  EXPECT_EQ(judged(one(trial("prestress_relaxation", {-0.2, 10}, 0.1))).verdict, Verdict::named);
}

// Two effects of which neither is sufficient: of an excess of 100 above 100 of noise they leave these shares.
ForwardSelection insufficient(double first, double second) {
  ForwardSelection out;
  out.detected = true;
  out.excess = 100;  // mean square over 1
  for (const auto& [id, left] :
       {std::pair{"prestress_relaxation", first}, std::pair{"load_cell_creep", second}}) {
    auto t = trial(id, {0.02, 10}, 0.1);
    t.fit.residual = Eigen::VectorXd::Random(static_cast<Eigen::Index>(samples));
    t.fit.squares = samples * (1 + 100 * left);
    t.left = 1000;
    out.trials.push_back(std::move(t));
  }
  return out;
}

// Where the model's own physics is a little off nothing is ever sufficient, and an effect that takes nearly
// all of the gap is named all the same.
TEST(Verdict, NamesWhatLeavesLittle) {
  const auto forward = insufficient(0.05, 0.9);
  const auto found = judged(forward);
  EXPECT_EQ(found.verdict, Verdict::named);
  EXPECT_EQ(found.trials.front().first->effects.front()->id, "prestress_relaxation");
  EXPECT_LT(found.probability_unknown, 0.05);
}

TEST(Verdict, NamesNothingThatLeavesHalf) {
  const auto forward = insufficient(0.5, 0.9);
  const auto found = judged(forward);
  EXPECT_EQ(found.verdict, Verdict::unknown);
  EXPECT_GT(found.probability_unknown, 0.5);
  EXPECT_NEAR(probability_of_unknown(options.material_share, options), 0.5, 1e-12);
}

// Of all recordings together an effect has to take as much as of those that were learned from.
TEST(Verdict, WhatTheLockedRecordingsKeepIsNotNamed) {
  const auto forward = insufficient(0.05, 0.9);
  const double learned = 100 * samples;
  for (const double kept : {0.2, 0.9}) {  // of the locked recordings, that show half as much
    auto found = judged(forward);
    ASSERT_TRUE(found.excess);
    EXPECT_DOUBLE_EQ(found.excess->before, learned);
    const double before = found.probability_unknown;
    const ExcessTaken locked{0.5 * learned, kept * 0.5 * learned};
    const double drop = found.trials.front().first->drop;
    const double share = 1 - (found.excess->left + locked.left) / (1.5 * learned);
    EXPECT_EQ(refute(found, drop, locked, options), share < options.material_share) << share;
    if (kept < 0.5) {
      EXPECT_EQ(found.verdict, Verdict::named);
      EXPECT_EQ(found.probability_unknown, before);
    } else {
      EXPECT_EQ(found.verdict, Verdict::unknown);
      EXPECT_EQ(found.doubted, &forward.trials.front());
      EXPECT_NEAR(found.probability_unknown, probability_of_unknown(share, options), 1e-9);
    }
  }
}

// Where a fit comes below the noise that was estimated, the noise is less, and what a single effect leaves
// above that fit may be a second one.
TEST(Verdict, NamesAPairThatComesBelowTheNoise) {
  for (const double left : {10.0, 400.0}) {  // of the pair, by all that could still be added to it
    auto forward = insufficient(0, 0.9);
    forward.trials[0].fit.squares = 0.97 * samples;
    auto pair = forward.trials[0];
    pair.effects.push_back(forward.trials[1].effects[0]);
    pair.fit.squares = 0.4 * samples;
    pair.left = left;
    forward.trials[0].left = 0.5 * samples;
    forward.trials.push_back(std::move(pair));
    const auto found = judged(forward);
    EXPECT_EQ(found.verdict, Verdict::named);
    EXPECT_EQ(found.trials.front().first->effects.size(), left < 0.1 * samples ? 2U : 1U) << left;
  }
}

TEST(Verdict, DoubtsWhatIsNotPlausible) {
  for (const double fraction : {0.72, -0.72, 0.001}) {
    const auto forward = one(trial("prestress_relaxation", {fraction, 10}, 0.1));
    const auto found = judged(forward);
    EXPECT_EQ(found.verdict, Verdict::unknown) << fraction;
    EXPECT_EQ(found.doubted, &forward.trials[0]) << fraction;
    EXPECT_GT(found.probability_unknown, 0.9) << fraction;
  }
  EXPECT_EQ(judged(one(trial("prestress_relaxation", {0.2, 1e7}, 0.1))).verdict, Verdict::unknown);
}

// 90 % are 1.645 standard deviations.
TEST(Verdict, DoubtsWhatMayBeNothing) {
  EXPECT_EQ(judged(one(trial("prestress_relaxation", {0.2, 10}, 0.55))).verdict, Verdict::named);
  EXPECT_EQ(judged(one(trial("prestress_relaxation", {0.2, 10}, 0.65))).verdict, Verdict::unknown);
  // On a logarithmic scale: it reaches to where an effect is too weak to be looked for.
  EXPECT_EQ(judged(one(trial("viscoelastic_creep", {1e-12, 1}, 0.5))).verdict, Verdict::named);
  EXPECT_EQ(judged(one(trial("viscoelastic_creep", {1e-12, 1}, 20))).verdict, Verdict::unknown);
}

// A spring that only pushes shows however narrow the gap is, and at one of which nothing is known but that it
// is narrow.
TEST(Verdict, BelievesWhatIsThereAtAnyAmplitude) {
  EXPECT_EQ(judged(one(trial("contact_gap", {1e-8}, 20))).verdict, Verdict::named);
  EXPECT_EQ(judged(one(trial("contact_gap", {1e-9}, 0.1))).verdict, Verdict::named);
  EXPECT_EQ(judged(one(trial("contact_gap", {1e-4}, 0.1))).verdict, Verdict::unknown);
}

// As a rival too: it needs no larger amplitude to be plausible.
TEST(Verdict, CountsARivalThatIsThereAtAnyAmplitude) {
  auto forward = one(trial("viscoelastic_creep", {1e-12, 1}, 0.1));
  forward.trials.push_back(trial("contact_gap", {1e-9}, 0.1));
  const auto found = judged(forward);
  EXPECT_EQ(found.verdict, Verdict::ambiguous);
  ASSERT_EQ(found.trials.size(), 2u);
  // A number less: ln(samples) in the difference of the information criterion, which is tempered.
  const double more = 0.5 * std::log(samples) / options.likelihood_tempering;
  EXPECT_NEAR(std::log(found.trials[0].second / found.trials[1].second), 0, more);
}

// Another that is to be believed is named though it fits less well.
TEST(Verdict, PrefersWhatIsToBeBelieved) {
  auto forward = one(trial("prestress_relaxation", {0.72, 10}, 0.01));
  forward.trials.push_back(trial("viscoelastic_creep", {1e-12, 1}, 0.1));
  forward.trials[1].drop = 900;
  const auto found = judged(forward);
  EXPECT_EQ(found.verdict, Verdict::named);
  EXPECT_EQ(found.doubted, nullptr);
  ASSERT_EQ(found.trials.size(), 1u);
  EXPECT_EQ(found.trials[0].first, &forward.trials[1]);
}

// An estimate that is hardly known may be beyond what is plausible, and the effect explain as much within it.
TEST(Verdict, CannotTellFromARivalThatMayBePlausible) {
  auto forward = one(trial("prestress_relaxation", {0.72, 10}, 0.65));
  forward.trials.push_back(trial("viscoelastic_creep", {1e-12, 1}, 0.1));
  const auto found = judged(forward);
  EXPECT_EQ(found.verdict, Verdict::ambiguous);
  ASSERT_EQ(found.trials.size(), 2u);
  // 0.55 of 0.72 known to 0.468: the evidence for the rival falls by exp(-(0.17 / 0.468)^2 / 2).
  EXPECT_EQ(found.trials[0].first, &forward.trials[1]) << "it is the one that is added";
  EXPECT_NEAR(found.trials[1].second / found.trials[0].second, std::exp(-std::pow(0.17 / 0.468, 2) / 2),
              1e-3);
}

TEST(Verdict, SaysWhatIsDoubted) {
  Discovery d;
  d.verdict = Verdict::unknown;
  d.doubted = effect_estimates(trial("prestress_relaxation", {0.72, 10}, 0.1), options);
  const auto sentence = findings(d).front();
  EXPECT_THAT(sentence, testing::HasSubstr("cannot be told"));
  EXPECT_THAT(sentence, testing::HasSubstr("prestress relaxation would explain it, fraction = 0.72"));
  EXPECT_EQ(to_json(d).at("doubted").at("effects").at(0).at("id"), "prestress_relaxation");
}

TEST(SelectionOptions, DetectNothingBelowWhatSimulationsResolve) {
  auto raised = options;
  raised.raise_detection(0.5 * options.detection);
  EXPECT_EQ(raised.detection, options.detection) << "noise hides more";
  raised.raise_detection(10 * options.detection);
  EXPECT_EQ(raised.detection, 10 * options.detection);
  EXPECT_EQ(raised.second_detection, 10 * options.second_detection);
  EXPECT_EQ(allowed_remainder(raised, 0), raised.second_detection);
}

TEST(SelectionOptions, SayWhatIsWrongWithThem) {
  std::string error;
  EXPECT_TRUE(SelectionOptions{}.is_valid(&error)) << error;
  EXPECT_FALSE((SelectionOptions{.detection = -1}.is_valid(&error)));
  EXPECT_THAT(error, testing::HasSubstr("detection"));
  EXPECT_FALSE((SelectionOptions{.hopeless_remainder = 2}.is_valid(&error)));
  EXPECT_THAT(error, testing::HasSubstr("hopeless_remainder"));
  EXPECT_FALSE((SelectionOptions{.confident = 1}.is_valid(nullptr)));
  EXPECT_FALSE((SelectionOptions{.material_share = 1}.is_valid(&error)));
  EXPECT_THAT(error, testing::HasSubstr("material_share"));
}

TEST(SelectionOptions, AreEachCheckedAgainstItsRange) {
  for (const auto& threshold : thresholds())
    if (const auto* member = std::get_if<double SelectionOptions::*>(&threshold.member)) {
      SelectionOptions wrong;
      wrong.** member = threshold.range == Threshold::Range::below_one ? 1.5 : -1;
      std::string error;
      EXPECT_FALSE(wrong.is_valid(&error)) << threshold.name;
      EXPECT_THAT(error, testing::StartsWith(std::string(threshold.name)));
    }
}

TEST(SelectionOptions, AreHalvedAndDoubledOneByOne) {
  for (const auto& threshold : thresholds())
    for (const double factor : {0.5, 2.0}) {
      const auto changed = scaled({}, threshold, factor);
      std::string error;
      EXPECT_TRUE(changed.is_valid(&error)) << error;
      EXPECT_NE(value_of(changed, threshold), value_of({}, threshold)) << threshold.name;
      for (const auto& other : thresholds()) {
        if (other.name == threshold.name) continue;
        EXPECT_EQ(value_of(changed, other), value_of({}, other)) << threshold.name << ", " << other.name;
      }
    }
  const auto confident = *std::ranges::find(thresholds(), "confident", &Threshold::name);
  EXPECT_NEAR(scaled({}, confident, 2).confident, 0.8, 1e-12) << "0.1 from one before, 0.2 now";
}

}  // namespace
}  // namespace ferrobench::model::inference
