// The linear oscillator m x'' + c x' + k x = f, exact for a force that goes linearly over the step.
#pragma once

#include <cmath>

namespace ferrobench::model {

struct Oscillator {
  double mass = 1;                                                  // kg
  double damping = 0;                                               // c, N s/m
  double stiffness = 1;                                             // k, N/m
  double frequency() const { return std::sqrt(stiffness / mass); }  // undamped, rad/s
};

struct Motion {
  double position = 0;  // m
  double velocity = 0;  // m/s
};

// The motion that a force `f` rising at `rate` [N/s] leaves when all ringing has gone.
inline Motion steady(const Oscillator& o, double f, double rate) {
  return {(f - o.damping * rate / o.stiffness) / o.stiffness, rate / o.stiffness};
}

inline Motion swing(const Oscillator& o, const Motion& from, double f0, double f1, double h) {
  if (h <= 0) return from;
  const double rate = (f1 - f0) / h;
  const Motion before = steady(o, f0, rate), after = steady(o, f1, rate);
  const double e = from.position - before.position, v = from.velocity - before.velocity;
  // With g = c / 2m: cosine = e^-gh cos(wh), sine = e^-gh sin(wh) / w, or their hyperbolic kin.
  const double g = 0.5 * o.damping / o.mass, square = o.stiffness / o.mass;
  const double difference = square - g * g, w = std::sqrt(std::abs(difference));
  double cosine = 0, sine = 0;
  if (w * h < 1e-4) {
    cosine = std::exp(-g * h);
    sine = h * cosine;
  } else if (difference > 0) {
    cosine = std::exp(-g * h) * std::cos(w * h);
    sine = std::exp(-g * h) * std::sin(w * h) / w;
  } else {
    // The slow root as a quotient, for g - w would cancel.
    const double slow = std::exp(-square / (g + w) * h), fast = std::exp(-(g + w) * h);
    cosine = 0.5 * (slow + fast);
    sine = 0.5 * (slow - fast) / w;
  }
  return {after.position + e * (cosine + g * sine) + v * sine,
          after.velocity + v * (cosine - g * sine) - square * e * sine};
}

}  // namespace ferrobench::model
