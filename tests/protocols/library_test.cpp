// The shipped experiments: every row of the source is there, with the corners its figure shows.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "tests/protocols/programs.h"

namespace ferrobench::protocols {
namespace {

using testing::DoubleNear;
using testing::Pointwise;

struct Expected {
  std::vector<double> levels;  // corners in the protocol's unit
  double rate;                 // per second, same unit
  double longest_hold;         // s
};

// From `top` to each level, stay, back to `top`, stay: the corners of a creep program.
std::vector<double> holds(double top, const std::vector<double>& levels) {
  std::vector<double> out{top};
  for (const double level : levels) out.insert(out.end(), {level, level, top, top});
  return out;
}

std::vector<double> loops(double top, const std::vector<double>& levels, bool rest) {
  std::vector<double> out{top};
  for (const double level : levels) {
    out.insert(out.end(), {level, top});
    if (rest) out.push_back(top);
  }
  return out;
}

const std::vector<double> sixteen{0.5,   0,     -0.3, -0.35, -0.38, -0.4, -0.42, -0.44,
                                  -0.46, -0.48, -0.5, -0.55, -0.65, -0.8, -1,    -1.5};
const std::vector<double> six{0, -0.45, -0.5, -0.55, -0.8, -1.5};
const std::vector<double> volts{125, 100, 75, 50, 25, 0};

// At each bias: there, at the end of its stay, and after its sine.
std::vector<double> biases() {
  std::vector<double> out{0};
  for (int tenths = 15; tenths >= -15; --tenths) out.insert(out.end(), 3, tenths / 10.0);
  for (int tenths = -14; tenths <= 15; ++tenths) out.insert(out.end(), 3, tenths / 10.0);
  out.push_back(0);
  return out;
}

const std::map<std::string, Expected> expected{
    {"full-loops", {{1.5, -1.5, 1.5, -1.5, 1.5}, 1, 0}},
    {"stroke-against-rate-actuator-range", {{0, 1.5, 0, 1.5, 0}, 0.05, 0}},
    {"stroke-against-rate-extended-range", {{0, 1.5, -0.4, 0, 1.5, -0.4, 0}, 0.05, 0}},
    {"minor-loops-first-order", {loops(1.5, {1.25, 1, 0.75, 0.5, 0.25, 0}, false), 0.05, 0}},
    {"creep-16-holds-free", {holds(1.5, sixteen), 0.5, 15}},
    {"creep-16-holds-spring", {holds(1.5, sixteen), 0.1, 15}},
    {"creep-6-holds-stiff-spring", {holds(1.5, six), 0.1, 15}},
    {"creep-6-holds-slow", {holds(1.5, six), 0.1, 15}},
    {"creep-6-holds-fast", {holds(1.5, six), 1, 15}},
    {"small-signal", {biases(), 2, 1}},
    {"stage-full-range", {{0, 150, 0, 150, 0}, 5, 0}},
    {"stage-first-order-loops", {loops(150, volts, true), 5, 5}},
    {"stage-second-order-loops", {{150, 0, 25, 0, 50, 0, 75, 0, 100, 0, 125, 0, 150, 0}, 5, 0}},
    {"stage-third-order-loops",
     {{150, 125, 150, 0,   150, 150, 100, 125, 0,   150, 150, 75, 100, 0,   150, 150,
       50,  75,  0,   150, 150, 25,  50,  0,   150, 150, 0,   25, 0,   150, 150},
      5,
      5}},
    {"stage-creep-slow", {holds(150, volts), 5, 15}},
    {"stage-creep-fast", {holds(150, volts), 500, 15}},
    {"stage-stroke-against-rate", {{0, 150, 0, 150, 0}, 5, 0}}};

TEST(Library, HasWhatIsExpectedAndNothingElse) {
  std::vector<std::string> names;
  for (const auto& [name, what] : expected) names.push_back(name);
  EXPECT_EQ(library_names(), names);
}

TEST(Library, ProtocolsHaveTheCornersOfTheirFigures) {
  for (const auto& [name, what] : expected) {
    SCOPED_TRACE(name);
    const auto protocol = library_protocol(name);
    EXPECT_EQ(protocol.name(), name);
    EXPECT_TRUE(validate(protocol.json()).empty());
    EXPECT_NE(protocol.json().value("source", "").find("figure"), std::string::npos);
    const bool volt = protocol.json()["unit"] == "V";
    const double unit = volt ? 1e4 : 1e6;
    const auto waveform = protocol.expand();
    EXPECT_THAT(corner_levels(waveform, unit), Pointwise(DoubleNear(1e-9), what.levels));
    EXPECT_NEAR(waveform.max_slew() / unit, what.rate, 1e-9 * what.rate);
    double longest = 0;
    for (const auto& segment : waveform.segments())
      if (segment.kind == "hold") longest = std::max(longest, segment.end - segment.start);
    EXPECT_NEAR(longest, what.longest_hold, 1e-9);
  }
}

TEST(Library, ProtocolsTakeAnotherRate) {
  for (const auto& name : library_names()) {
    SCOPED_TRACE(name);
    const auto protocol = library_protocol(name);
    const double rate = protocol.parameters().at("rate");
    EXPECT_NEAR(protocol.expand({.parameters = {{"rate", 10 * rate}}}).max_slew(),
                10 * protocol.expand().max_slew(), 1e-6);
  }
}

TEST(Library, ProtocolsAreSampledFinelyButNotHugely) {
  for (const auto& name : library_names()) {
    SCOPED_TRACE(name);
    const auto protocol = library_protocol(name);
    const SampledWaveform sampled(protocol.expand(), protocol.sample_rate().value());
    const double sweep = sampled.waveform().maximum() - sampled.waveform().minimum();
    EXPECT_GE(sweep / sampled.waveform().max_slew() * sampled.rate(), 200);
    EXPECT_LE(sampled.size(), 300000U);
    EXPECT_LT(sampled.distortion(), 1 / sampled.rate());
  }
}

TEST(Library, CreepHoldsAreNumberedInTheOrderOfTheTable) {
  const auto waveform = library_protocol("creep-16-holds-spring").expand();
  std::vector<double> levels;
  for (const auto& segment : waveform.segments())
    if (segment.label == "hold " + std::to_string(levels.size() + 1)) levels.push_back(segment.level / 1e6);
  EXPECT_THAT(levels, Pointwise(DoubleNear(1e-9), sixteen));
}

TEST(Library, SaysWhatIsNearAnUnknownName) {
  try {
    library_protocol("creep-6-holds-fasst");
    FAIL() << "found";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::not_found);
    EXPECT_EQ(error.problems().at(0).hint, "did you mean \"creep-6-holds-fast\"?");
  }
  EXPECT_THROW(library_protocol(""), Error);
  EXPECT_THROW(library_protocol("../library/full-loops"), Error);
}

}  // namespace
}  // namespace ferrobench::protocols
