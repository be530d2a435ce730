// The campaign's own parts: benches come out as stated, and answers are counted rightly.
#include "tests/campaign/bench.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "model/inference/report/discovery_report.h"
#include "recordings/file/reader.h"
#include "tests/campaign/table.h"

namespace ferrobench::campaign {
namespace {

using recordings::Channel;

constexpr BenchOptions coarse{.domains = 480};

TEST(Bench, HoldsWhatIsAskedFor) {
  const auto bench = make_bench(5, 4, Kind::single, coarse);
  ASSERT_EQ(bench.recordings.size(), 8u);
  std::size_t samples = 0;
  for (const auto& [name, r] : bench.recordings) {
    samples += r.size();
    EXPECT_TRUE(r.segments.empty()) << name;
    EXPECT_TRUE(r.header.model.is_null()) << name;
    for (const auto channel : {Channel::field, Channel::charge, Channel::displacement, Channel::force}) {
      ASSERT_TRUE(r.has(channel)) << name;
      EXPECT_FALSE(r.noise.at(static_cast<std::size_t>(channel)).has_value()) << name;
      for (const double v : r.at(channel)) ASSERT_TRUE(std::isfinite(v)) << name;
    }
  }
  EXPECT_NEAR(static_cast<double>(samples), 30000, 5000);
  ASSERT_EQ(bench.effects.size(), 1u);
  EXPECT_GT(bench.sizes[0], 1.2);
  EXPECT_LT(bench.sizes[0], 60);
  const double moved = bench.base.material.barrier / bench.handed.material.barrier;
  EXPECT_GT(std::abs(moved - 1), 0.04);
  EXPECT_LT(std::abs(moved - 1), 0.11);
}

TEST(Bench, IsTheSameForTheSameSeed) {
  const auto a = make_bench(5, 1, Kind::nothing, coarse), b = make_bench(5, 1, Kind::nothing, coarse),
             c = make_bench(6, 1, Kind::nothing, coarse);
  EXPECT_EQ(truth_of(a), truth_of(b));
  EXPECT_NE(truth_of(a), truth_of(c));
  EXPECT_EQ(a.recordings[0].recording.at(Channel::charge), b.recordings[0].recording.at(Channel::charge));
}

TEST(Bench, CanBeWrittenAndReadBack) {
  const auto folder = std::filesystem::path(testing::TempDir()) / "ferrobench-campaign";
  std::filesystem::remove_all(folder);
  const auto bench = make_bench(5, 2, Kind::withheld, coarse);
  EXPECT_EQ(std::find(bench.candidates.begin(), bench.candidates.end(), bench.effects[0].id),
            bench.candidates.end());
  write_bench(bench, folder.string());
  const auto handed = model::model_from_file((folder / "model.json").string());
  EXPECT_EQ(model::to_json(handed), model::to_json(bench.handed));
  nlohmann::json truth;
  std::ifstream(folder / "truth.json") >> truth;
  EXPECT_EQ(truth, truth_of(bench));
  const auto& [name, recording] = bench.recordings.front();
  const auto read = recordings::read_recording((folder / (name + ".h5")).string());
  EXPECT_EQ(read.at(Channel::force), recording.at(Channel::force));

  const auto again = read_truth(folder.string());
  EXPECT_EQ(again.kind, bench.kind);
  EXPECT_EQ(again.candidates, bench.candidates);
  EXPECT_EQ(again.families, bench.families);
  ASSERT_EQ(again.effects.size(), bench.effects.size());
  EXPECT_EQ(again.effects[0].parameters, bench.effects[0].parameters);

  const auto whole = read_bench(folder.string());
  EXPECT_EQ(whole.candidates, bench.candidates);
  EXPECT_EQ(model::to_json(whole.handed), model::to_json(bench.handed));
  ASSERT_EQ(whole.recordings.size(), bench.recordings.size());
  EXPECT_EQ(whole.recordings.back().name, bench.recordings.back().name);
  EXPECT_EQ(whole.recordings.back().recording.at(Channel::charge),
            bench.recordings.back().recording.at(Channel::charge));
  std::filesystem::remove_all(folder);
}

Outcome answered(const std::set<std::string>& truth, const std::string& verdict,
                 const std::set<std::string>& named, double probability, Kind kind = Kind::single) {
  Outcome o;
  o.kind = kind;
  o.truth = truth;
  o.in_catalogue = kind != Kind::outside;
  o.verdict = verdict;
  o.named = named;
  o.probability = probability;
  return o;
}

TEST(Score, CountsAnswers) {
  EXPECT_TRUE(answered({"a"}, "named", {"a"}, 0.9).right());
  EXPECT_FALSE(answered({"a"}, "named", {"a", "b"}, 0.9).right());
  EXPECT_TRUE(answered({"a"}, "named", {"a", "b"}, 0.9).wrong_name());
  EXPECT_TRUE(answered({"a", "b"}, "named", {"a"}, 0.9, Kind::pair).hit());
  EXPECT_FALSE(answered({"a", "b"}, "named", {"a"}, 0.9, Kind::pair).wrong_name());
  EXPECT_TRUE(answered({}, "nothing_missing", {}, 0.9, Kind::nothing).right());
  EXPECT_TRUE(answered({}, "ambiguous", {"a"}, 0.5, Kind::nothing).wrong_name());
  EXPECT_TRUE(answered({"x"}, "unknown", {}, 0.7, Kind::outside).right());
  EXPECT_TRUE(answered({"x"}, "named", {"a"}, 0.7, Kind::outside).wrong_name());
}

TEST(Score, AnotherPhysicsMayBeUnknownAndIsNoEffect) {
  EXPECT_TRUE(answered({}, "nothing_missing", {}, 0.9, Kind::physics).right());
  EXPECT_TRUE(answered({}, "unknown", {}, 0.9, Kind::physics).right());
  EXPECT_FALSE(answered({}, "named", {"a"}, 0.9, Kind::physics).right());
  EXPECT_FALSE(answered({"a"}, "unknown", {}, 0.9, Kind::physics).right());
  EXPECT_TRUE(answered({"a"}, "named", {"a"}, 0.9, Kind::physics).right());
}

TEST(Score, TellsTheEffectOverWhatThePhysicsLeaves) {
  Bench b;
  b.kind = Kind::physics;
  b.left = 0.5;
  b.sizes = {4, 1.5};
  model::Discovery d;
  d.share_held_out = 0.75;
  const auto o = score(b, to_json(d));
  EXPECT_DOUBLE_EQ(o.over_left, 3);
  EXPECT_DOUBLE_EQ(o.share_held_out, 0.75);
}

// An answer that says how strong a thing must be to show is right about what is weaker.
TEST(Score, WhatIsTooWeakToShowIsToldApartFromWhatIsMissed) {
  Bench b;
  b.kind = Kind::single;
  model::Discovery d;
  d.verdict = model::Verdict::nothing_missing;
  const auto counted = [&](const std::string& id, const std::string& name, double hidden, double smallest) {
    b.effects = {{id, {{name, hidden}}}};
    d.smallest_detectable = {{id, {{name, smallest}}}};
    const auto o = score(b, to_json(d));
    EXPECT_FALSE(o.right());
    return o.class_right;
  };
  EXPECT_TRUE(counted("electrostriction", "coefficient", -2e-17, 3e-17));
  EXPECT_FALSE(counted("electrostriction", "coefficient", -4e-17, 3e-17));
  // The softer, the stronger.
  EXPECT_TRUE(counted("passive_layer_compliance", "stiffness", 7e7, 6e7));
  EXPECT_FALSE(counted("passive_layer_compliance", "stiffness", 5e7, 6e7));
  d.smallest_detectable.clear();
  EXPECT_FALSE(score(b, to_json(d)).class_right);
  d.not_testable = {"passive_layer_compliance"};
  EXPECT_TRUE(score(b, to_json(d)).class_right);
  d.verdict = model::Verdict::unknown;
  EXPECT_FALSE(score(b, to_json(d)).class_right);
}

TEST(Score, CalibrationIsTheDistanceFromStatedToRight) {
  std::vector<Outcome> outcomes;
  for (int i = 0; i < 10; ++i) outcomes.push_back(answered({"a"}, "named", {i < 8 ? "a" : "b"}, 0.95));
  const auto r = reliability(outcomes);
  EXPECT_EQ(r.bins.at(9).count, 10u);
  outcomes.front().probability = 0.99;
  EXPECT_EQ(reliability(outcomes).bins.back().count, 1u);
  outcomes.front().probability = 1;
  EXPECT_EQ(reliability(outcomes).bins.back().count, 1u);
  outcomes.front().probability = 0;
  EXPECT_EQ(reliability(outcomes).bins.front().count, 1u);
  EXPECT_THAT(text_of(outcomes), testing::HasSubstr("| named | 0.9 to 0.99 | 9 | 0.950 | 0.778 |"));
  outcomes.front().probability = 0.95;
  EXPECT_NEAR(r.expected_calibration_error, 0.15, 1e-12);
  EXPECT_NEAR(r.brier, (8 * 0.05 * 0.05 + 2 * 0.95 * 0.95) / 10, 1e-12);
  for (const auto& figure : figures(outcomes)) {
    if (figure.name.starts_with("single effect: right name")) {
      EXPECT_NEAR(figure.value, 0.8, 1e-12);
    }
    if (figure.name.starts_with("wrong name")) {
      EXPECT_NEAR(figure.value, 0.2, 1e-12);
    }
  }
}

}  // namespace
}  // namespace ferrobench::campaign
