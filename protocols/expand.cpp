#include "protocols/expand.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

namespace ferrobench::protocols {
namespace {

// The label given, or one made up. A label of a segment with several rows stands before each of them instead.
std::string own(const Node& node, const std::string& made_up) {
  return node.label.empty() ? made_up : node.label;
}
std::string before(const Node& node, const std::string& prefix) {
  return node.label.empty() ? prefix : prefix + node.label + ": ";
}

void play(const Ramp& s, const Node& node, const std::string& prefix, Builder& b) {
  b.enter(node.path, prefix);
  if (!b.moves_to(s.to)) return b.hold(s.time.value_or(0), own(node, "wait"));
  const auto label = own(node, "ramp " + b.next_ramp() + b.direction(s.to));
  if (s.rate) {
    b.ramp_to(s.to, *s.rate, label);
  } else {
    b.ramp_in(s.to, *s.time, label);
  }
}

void play(const Hold& s, const Node& node, const std::string& prefix, Builder& b) {
  b.enter(node.path, prefix);
  if (s.time > 0) b.hold(s.time, own(node, "hold " + b.next_hold()));
}

void play(const Repeat& s, const Node& node, const std::string& prefix, Builder& b) {
  const auto recorded = b.recorded();
  if (s.average) b.average(node.path);
  for (std::int64_t i = 1; i <= s.count; ++i) {
    b.enter(node.path, prefix);
    if (s.average) b.begin_pass();
    expand(s.nodes, node.label.empty() ? prefix : prefix + node.label + " " + std::to_string(i) + ": ",
           recorded, b);
  }
  if (s.average) b.begin_pass();  // where the last one ends
}

std::vector<double> turning_points(const Reversals& s) {
  if (s.points) return *s.points;
  std::vector<double> points;
  for (std::int64_t i = 0; i < *s.count; ++i)
    points.push_back(*s.count == 1 ? *s.first
                                   : std::lerp(*s.first, *s.last,
                                               static_cast<double>(i) / static_cast<double>(*s.count - 1)));
  return points;
}

void play(const Reversals& s, const Node& node, const std::string& prefix, Builder& b) {
  b.enter(node.path, before(node, prefix));
  if (s.order == 2) b.ramp_to(*s.back_to, s.rate, "approach");
  for (const double point : turning_points(s)) {
    const auto name = "reversal " + b.next_reversal();
    b.ramp_to(point, s.rate, name + b.direction(point));
    if (s.hold > 0) b.hold(s.hold, "hold " + b.next_hold());
    if (s.order == 3) {
      b.ramp_to(point + *s.rise, s.rate, name + b.direction(point + *s.rise));
      b.ramp_to(*s.through, s.rate, name + b.direction(*s.through) + " 2");
    }
    if (!s.back_to) continue;
    b.ramp_to(*s.back_to, s.rate, name + b.direction(*s.back_to) + (s.order == 3 ? " 2" : ""));
    b.hold(s.hold_back, name + " rest");
  }
}

void play(const Triangle& s, const Node& node, const std::string& prefix, Builder& b) {
  b.enter(node.path, before(node, prefix));
  const double rate = s.rate ? *s.rate : 2 * (s.high - s.low) * *s.frequency;
  b.ramp_to(std::clamp(b.level(), s.low, s.high), rate, "approach");
  const double home = b.level();
  const std::array<double, 2> turns =
      s.first == Direction::up ? std::array{s.high, s.low} : std::array{s.low, s.high};
  for (std::int64_t i = 1; i <= s.cycles; ++i) {
    const auto name = "cycle " + std::to_string(i);
    for (const double to : turns) b.ramp_to(to, rate, name + b.direction(to));
    b.ramp_to(home, rate, name + b.direction(home) + (home == turns[0] ? "" : " 2"));
  }
}

void play(const Sine& s, const Node& node, const std::string& prefix, Builder& b) {
  b.enter(node.path, prefix);
  const double phase = s.phase * std::numbers::pi / 180;
  const double steepest = 2 * std::numbers::pi * s.frequency * s.amplitude;
  b.ramp_to(s.center + s.amplitude * std::sin(phase), steepest, own(node, "sine") + " approach");
  b.sine(s.center, s.amplitude, s.frequency, s.cycles, phase, own(node, "sine"));
}

void play(const Pund& s, const Node& node, const std::string& prefix, Builder& b) {
  b.enter(node.path, before(node, prefix));
  const double rate = s.rate ? *s.rate : std::abs(s.amplitude) / *s.rise;
  b.ramp_to(0, rate, "approach");
  const std::array<std::pair<std::string, double>, 5> pulses{{{"preset pulse", -s.amplitude},
                                                              {"pulse P", s.amplitude},
                                                              {"pulse U", s.amplitude},
                                                              {"pulse N", -s.amplitude},
                                                              {"pulse D", -s.amplitude}}};
  for (const auto& [name, top] : pulses) {
    b.ramp_to(top, rate, name + " rise");
    b.hold(s.width, name);
    b.ramp_to(0, rate, name + " fall");
    b.hold(s.delay, name + " delay");
  }
}

void play(const SmallSignal& s, const Node& node, const std::string& prefix, Builder& b) {
  b.enter(node.path, before(node, prefix));
  for (const double level : s.levels) {
    const auto name = "bias " + b.next_bias();
    b.ramp_to(level, s.rate, name + b.direction(level));
    b.hold(s.settle, name + " settle");
    b.sine(b.level(), s.amplitude, s.frequency, static_cast<double>(s.cycles), 0, name + " sine",
           small_signal_samples);
  }
}

void play(const Points& s, const Node& node, const std::string& prefix, Builder& b) {
  b.enter(node.path, before(node, prefix));
  const auto& rows = *s.points;
  double steepest = 0;
  for (std::size_t i = 1; i < rows.size(); ++i)
    steepest = std::max(steepest, std::abs(rows[i][1] - rows[i - 1][1]) / (rows[i][0] - rows[i - 1][0]));
  double time = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto label = "point " + std::to_string(i + 1);
    const double passed = rows[i][0] - time;
    time = rows[i][0];
    if (passed == 0) {
      b.ramp_to(rows[i][1], steepest, "approach");
    } else if (b.moves_to(rows[i][1])) {
      b.ramp_in(rows[i][1], passed, label);
    } else {
      b.hold(passed, label);
    }
  }
}

}  // namespace

void expand(const std::vector<Node>& nodes, const std::string& prefix, const Recorded& recorded,
            Builder& builder) {
  for (const auto& node : nodes) {
    const auto& own = node.recorded;
    builder.record({.rate = own.rate > 0 ? own.rate : recorded.rate,
                    .per_decade = own.per_decade > 0 ? own.per_decade : recorded.per_decade});
    std::visit([&](const auto& segment) { play(segment, node, prefix, builder); }, node.body);
  }
}

}  // namespace ferrobench::protocols
