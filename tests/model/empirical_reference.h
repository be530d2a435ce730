// An empirical term once more, as plainly as can be: moved in tiny steps, the plays as rigid pieces with
// slack that are pushed, the lags by Euler's rule.
#pragma once

#include <array>
#include <cmath>
#include <map>
#include <string>

#include "tests/model/effects_support.h"

namespace ferrobench::model {

class PlainTerm {
 public:
  PlainTerm(const std::map<std::string, double>& parameters, const std::string& id) {
    const auto of = [&](const std::string& name) {
      const auto found = parameters.find(id + "." + name);
      return found == parameters.end() ? 0 : found->second;
    };
    const auto read = [&](const std::string& name, auto& weights) {
      for (std::size_t i = 0; i < weights.size(); ++i) weights[i] = of(name + "_" + std::to_string(i));
    };
    const std::string input = id == "empirical_spring" ? "extension" : "field";
    amplitude_ = of("amplitude");
    field_scale_ = of(input + "_scale");
    time_constant_ = of("time_constant");
    read(input, field_);
    read("order", by_order_);
    read("ninety", by_ninety_);
    read("play", by_play_);
    by_lag_ = {of("lag_field"), of("lag_order"), of("lag_ninety")};
  }

  void start(double field, double order, double ninety) {
    if (field_scale_ == 0) return;
    now_ = lag_ = {field / field_scale_, order, ninety};
    push();
    at_start_ = value();
  }
  void step(double dt, double field, double order, double ninety) {
    if (field_scale_ == 0) return;
    now_ = {field / field_scale_, order, ninety};
    push();
    if (time_constant_ > 0)
      for (std::size_t k = 0; k < 3; ++k) lag_[k] += dt / time_constant_ * (now_[k] - lag_[k]);
  }

  // What a term with one input alone gives once its input has gone on to `input`.
  double beyond_rest_at(double input) const {
    auto there = *this;
    there.step(0, input, 1, 0);
    return there.beyond(0, 0, 0);
  }
  double beyond_start() const { return value() - at_start_; }
  // What it would be if it had been so for ever, with the plays in the middle.
  double beyond(double e, double order, double ninety) const {
    auto rest = *this;
    rest.now_ = rest.lag_ = {e, order, ninety};
    rest.plays_ = {};
    return value() - rest.value();
  }

 private:
  // The sum of hats over knots at equal distances, whose outermost do not fall again.
  template <std::size_t count>
  double table(const std::array<double, count>& heights) const {
    double sum = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const double width = 2.0 / (count - 1), knot = -1 + static_cast<double>(i) * width;
      const double bounded = std::fmin(1, std::fmax(-1, now_[0]));
      sum += heights[i] * std::fmax(0, 1 - std::fabs(bounded - knot) / width);
    }
    return sum;
  }
  void push() {
    for (std::size_t j = 0; j < radii.size(); ++j) {
      if (plays_[j] < now_[0] - radii[j]) plays_[j] = now_[0] - radii[j];
      if (plays_[j] > now_[0] + radii[j]) plays_[j] = now_[0] + radii[j];
    }
  }
  double value() const {
    if (amplitude_ == 0) return 0;
    double sum = table(field_) + now_[1] * table(by_order_) + now_[2] * table(by_ninety_);
    for (std::size_t j = 0; j < radii.size(); ++j) sum += by_play_[j] * plays_[j];
    for (std::size_t k = 0; k < 3; ++k) sum += by_lag_[k] * lag_[k];
    return amplitude_ * sum;
  }

  static constexpr std::array radii{0.05, 0.1, 0.2, 0.35, 0.5, 0.75};
  double amplitude_ = 0, field_scale_ = 0, time_constant_ = 0, at_start_ = 0;
  std::array<double, 9> field_{};
  std::array<double, 5> by_order_{}, by_ninety_{};
  std::array<double, 6> by_play_{}, plays_{};
  std::array<double, 3> by_lag_{}, now_{0, 1, 0}, lag_{0, 1, 0};  // of e, p and n
};

// Weights that have nothing in common, so that none can stand for another.
inline Parameters empirical_values(const std::string& id, double amplitude, double time_constant) {
  Parameters out;
  int i = 0;
  for (const auto& p : find_effect(id).parameters) {
    const std::string name(p.name);
    const double weight = 0.9 * std::sin(2.3 * ++i + 0.4);
    out.emplace_back(name, name == "amplitude"         ? amplitude
                           : name == "field_scale"     ? 1.87e6
                           : name == "extension_scale" ? 1.1e-5
                           : name == "time_constant"   ? time_constant
                                                       : weight);
  }
  return out;
}

}  // namespace ferrobench::model
