// The empirical terms: what is added at a port where something is missing that has no name. Tables that are
// fitted, not physics.
//
//   u = amplitude (f(e) + p g(e) + n q(e) + sum_j play_j P_j(e)
//                  + lag_field lag_tau(e) + lag_order lag_tau(p) + lag_ninety lag_tau(n)) - the same at rest
//
//   e  field over field_scale                1
//   p  x+ - x-                               1
//   n  1 - x+ - x-                           1
//   f  field_0 .. field_8, straight between its values at e = -1, -0.75, .. 1 and level beyond
//   g  order_0 .. order_4, q  ninety_0 .. ninety_4, likewise at e = -1, -0.5, 0, 0.5, 1
//   P_j  play (backlash) of e with the radius r_j: P follows e once it is r_j away. Weighted and added up
//   they
//      are a Prandtl-Ishlinskii operator (Krasnosel'skii and Pokrovskii 1989; Brokate and Sprekels 1996).
//
// A term with one input alone, the commanded field of the drive or the extension of the spring, is
//
//   u = amplitude (f(e) + sum_j play_j P_j(e)) - the same at e = 0 with the plays at rest,   e  input / scale
//
// The plays start at rest, in the middle of their dead zones at no field, and go from there straight to the
// first field; the lags start in equilibrium with the first state. Inputs are linear over a step, for which
// plays and lags are exact.
#pragma once

#include <algorithm>
#include <array>
#include <memory>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "model/effects/catalogue.h"
#include "model/physics/lag.h"
#include "model/physics/ports.h"

namespace ferrobench::model::effects {

inline constexpr std::size_t field_knots = 9, fraction_knots = 5;
inline constexpr std::array play_radii{0.05, 0.1, 0.2, 0.35, 0.5, 0.75};

inline constexpr std::array<std::string_view, field_knots> field_table{
    "field_0", "field_1", "field_2", "field_3", "field_4", "field_5", "field_6", "field_7", "field_8"},
    extension_table{"extension_0", "extension_1", "extension_2", "extension_3", "extension_4",
                    "extension_5", "extension_6", "extension_7", "extension_8"};
inline constexpr std::array<std::string_view, play_radii.size()> play_weights{"play_0", "play_1", "play_2",
                                                                              "play_3", "play_4", "play_5"};

inline void add_weights(std::span<const std::string_view> names, std::vector<EffectParameter>& to) {
  for (const auto name : names) to.emplace_back(name, "1", 1e-2, 1, Sign::any);
}

// Of a term of the material: the amplitude and the scales, then the weights of f, g, q, the plays and the
// lags.
inline std::vector<EffectParameter> empirical_parameters(const EffectParameter& amplitude) {
  static constexpr std::array<std::string_view, 2 * fraction_knots> by_fractions{
      "order_0",  "order_1",  "order_2",  "order_3",  "order_4",
      "ninety_0", "ninety_1", "ninety_2", "ninety_3", "ninety_4"};
  static constexpr std::array<std::string_view, 3> lags{"lag_field", "lag_order", "lag_ninety"};
  std::vector<EffectParameter> out{amplitude,
                                   {"field_scale", "V/m", 1e5, 1e7, Sign::above_zero},
                                   {"time_constant", "s", 1e-3, 1e3, Sign::above_zero}};
  add_weights(field_table, out);
  add_weights(by_fractions, out);
  add_weights(play_weights, out);
  add_weights(lags, out);
  return out;
}

// Of a term with one input alone: the amplitude and the scale, then the weights of f and the plays.
inline std::vector<EffectParameter> empirical_parameters(const EffectParameter& amplitude,
                                                         const EffectParameter& scale,
                                                         std::span<const std::string_view> table) {
  std::vector<EffectParameter> out{amplitude, scale};
  add_weights(table, out);
  add_weights(play_weights, out);
  return out;
}

// A table over -1 <= e <= 1: straight between values at equal distances, level beyond.
template <class T, std::size_t count>
T from_table(const std::array<T, count>& values, const T& e) {
  if (e <= -1) return values.front();
  if (e >= 1) return values.back();
  const T at = (0.5 * (count - 1)) * (e + 1);
  const auto i = std::min(static_cast<std::size_t>(value_of(at)), count - 2);
  return values[i] + (at - static_cast<double>(i)) * (values[i + 1] - values[i]);
}

// Of an input that went from the last one to `e` without turning.
template <class T>
T play(const T& last, const T& e, double radius) {
  if (e - last > radius) return e - radius;
  if (last - e > radius) return e + radius;
  return last;
}

template <class T>
using Plays = std::array<T, play_radii.size()>;

template <class T>
Plays<T> played(Plays<T> plays, const T& e) {
  for (std::size_t j = 0; j < plays.size(); ++j) plays[j] = play(plays[j], e, play_radii[j]);
  return plays;
}

// The next of the values, in the order of the parameters.
template <class T>
class Reader {
 public:
  explicit Reader(Values<T> values) : values_(values) {}
  void operator()(T& to) { to = values_[at_++]; }
  template <std::size_t count>
  void operator()(std::array<T, count>& to) {
    for (T& v : to) v = values_[at_++];
  }

 private:
  Values<T> values_;
  std::size_t at_ = 0;
};

// u with one input alone.
template <class T>
class EmpiricalOperator {
 public:
  explicit EmpiricalOperator(Values<T> values) {
    Reader<T> read(values);
    read(amplitude_);
    read(scale_);
    read(table_);
    read(play_);
  }

  const T& amplitude() const { return amplitude_; }
  const T& scale() const { return scale_; }
  const Plays<T>& plays() const { return plays_; }

  void start() { plays_ = {}; }
  T propose(const T& input) const {
    const T e = input / scale_;
    const auto plays = played(plays_, e);
    T sum = from_table(table_, e) - table_[(field_knots - 1) / 2];
    for (std::size_t j = 0; j < play_.size(); ++j) sum += play_[j] * plays[j];
    return amplitude_ * sum;
  }
  void accept(const T& input) { plays_ = played(plays_, T(input / scale_)); }

 private:
  T amplitude_ = 0, scale_ = 1;
  std::array<T, field_knots> table_;
  Plays<T> play_;
  Plays<T> plays_{};
};

// What the rest is.
enum class Rest { at_start, poled };

// u as a term of the material. At rest is at the start, or at no field in the specimen that is poled towards
// +, where e = 0, p = 1 and n = 0.
template <class T>
class EmpiricalTerm final : public MaterialTerm<T> {
 public:
  EmpiricalTerm(Values<T> values, Rest rest) : rest_(rest) {
    Reader<T> read(values);
    read(amplitude_);
    read(field_scale_);
    read(time_constant_);
    read(field_);
    read(order_);
    read(ninety_);
    read(play_);
    read(lag_);
    if (rest == Rest::poled) at_rest_ = sum({.input = {0, 1, 0}, .plays = {}, .lags = {0, 1, 0}});
  }

  bool by_stress() const override { return false; }
  bool by_fractions() const override {
    const auto any = [](const auto& weights) {
      return std::any_of(weights.begin(), weights.end(), [](const T& w) { return !vanishes(w); });
    };
    return !vanishes(amplitude_) && (any(order_) || any(ninety_) || !vanishes(lag_[1]) || !vanishes(lag_[2]));
  }

  void start(const MaterialState<T>& at) override {
    memory_.input = memory_.lags = input_of(at);
    memory_.plays = played<T>({}, memory_.input[0]);
    if (rest_ == Rest::at_start) at_rest_ = sum(memory_);
  }
  T propose(const T& h, const MaterialState<T>& end) const override {
    return amplitude_ * (sum(after(h, end)) - at_rest_);
  }
  void accept(const T& h, const MaterialState<T>& end) override { memory_ = after(h, end); }

 private:
  using Three = std::array<T, 3>;  // of e, p and n
  struct Memory {
    Three input{};
    Plays<T> plays{};
    Three lags{};
  };

  Three input_of(const MaterialState<T>& s) const {
    return {s.field / field_scale_, s.plus - s.minus, s.ninety()};
  }
  Memory after(const T& h, const MaterialState<T>& end) const {
    Memory out{.input = input_of(end), .plays = {}, .lags = {}};
    for (std::size_t j = 0; j < play_.size(); ++j)
      if (!vanishes(play_[j])) out.plays[j] = play(memory_.plays[j], out.input[0], play_radii[j]);
    for (std::size_t k = 0; k < lag_.size(); ++k)
      if (!vanishes(lag_[k]))
        out.lags[k] = lag(memory_.lags[k], memory_.input[k], out.input[k], h, time_constant_);
    return out;
  }
  T sum(const Memory& m) const {
    const auto& [e, p, n] = m.input;
    T out = from_table(field_, e) + p * from_table(order_, e) + n * from_table(ninety_, e);
    for (std::size_t j = 0; j < play_.size(); ++j) out += play_[j] * m.plays[j];
    for (std::size_t k = 0; k < lag_.size(); ++k) out += lag_[k] * m.lags[k];
    return out;
  }

  Rest rest_;
  T amplitude_ = 0, field_scale_ = 1, time_constant_ = 1;
  std::array<T, field_knots> field_;
  std::array<T, fraction_knots> order_, ninety_;
  Plays<T> play_;
  Three lag_;
  T at_rest_ = 0;
  Memory memory_;
};

}  // namespace ferrobench::model::effects
