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
    for (const auto& [name, value] : parameters)
      if (name.starts_with(id + ".")) p_[name.substr(id.size() + 1)] = value;
  }

  void start(double field, double order, double ninety) {
    if (p_.empty()) return;
    e_ = field / p_.at("field_scale");
    order_ = lag_order_ = order;
    ninety_ = lag_ninety_ = ninety;
    lag_field_ = e_;
    push(e_);
    at_start_ = value();
  }
  void step(double dt, double field, double order, double ninety) {
    if (p_.empty()) return;
    e_ = field / p_.at("field_scale");
    order_ = order;
    ninety_ = ninety;
    push(e_);
    if (!p_.contains("time_constant")) return;
    const double share = dt / p_.at("time_constant");
    lag_field_ += share * (e_ - lag_field_);
    lag_order_ += share * (order_ - lag_order_);
    lag_ninety_ += share * (ninety_ - lag_ninety_);
  }

  double beyond_start() const { return p_.empty() ? 0 : value() - at_start_; }
  // What it would have been for ever, with the plays in the middle.
  double beyond(double e, double order, double ninety) const {
    if (p_.empty()) return 0;
    auto rest = *this;
    rest.e_ = rest.lag_field_ = e;
    rest.order_ = rest.lag_order_ = order;
    rest.ninety_ = rest.lag_ninety_ = ninety;
    rest.plays_ = {};
    return value() - rest.value();
  }

 private:
  double of(const std::string& name) const {
    const auto found = p_.find(name);
    return found == p_.end() ? 0 : found->second;
  }
  // The sum of hats over knots at equal distances, whose outermost do not fall again.
  double table(const std::string& name, int count) const {
    double sum = 0;
    for (int i = 0; i < count; ++i) {
      const double width = 2.0 / (count - 1), knot = -1 + i * width;
      const double bounded = std::fmin(1, std::fmax(-1, e_));
      sum += of(name + "_" + std::to_string(i)) * std::fmax(0, 1 - std::fabs(bounded - knot) / width);
    }
    return sum;
  }
  void push(double e) {
    for (std::size_t j = 0; j < radii.size(); ++j) {
      if (plays_[j] < e - radii[j]) plays_[j] = e - radii[j];
      if (plays_[j] > e + radii[j]) plays_[j] = e + radii[j];
    }
  }
  double value() const {
    double sum = table("field", 9) + order_ * table("order", 5) + ninety_ * table("ninety", 5);
    for (std::size_t j = 0; j < radii.size(); ++j) sum += of("play_" + std::to_string(j)) * plays_[j];
    sum += of("lag_field") * lag_field_ + of("lag_order") * lag_order_ + of("lag_ninety") * lag_ninety_;
    return of("amplitude") * sum;
  }

  static constexpr std::array radii{0.05, 0.1, 0.2, 0.35, 0.5, 0.75};
  std::map<std::string, double> p_;
  double e_ = 0, order_ = 1, ninety_ = 0, lag_field_ = 0, lag_order_ = 0, lag_ninety_ = 0, at_start_ = 0;
  std::array<double, 6> plays_{};
};

// Weights that have nothing in common, so that none can stand for another.
inline Parameters empirical_values(const std::string& id, double amplitude, double time_constant) {
  Parameters out;
  int i = 0;
  for (const auto& p : find_effect(id).parameters) {
    const std::string name(p.name);
    const double weight = 0.9 * std::sin(2.3 * ++i + 0.4);
    out.emplace_back(name, name == "amplitude"       ? amplitude
                           : name == "field_scale"   ? 1.87e6
                           : name == "time_constant" ? time_constant
                                                     : weight);
  }
  return out;
}

}  // namespace ferrobench::model
