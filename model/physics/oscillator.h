// The linear oscillator m x'' + c x' + k x = f, exact for a force that goes linearly over the step.
#pragma once

#include "model/physics/dual.h"

namespace ferrobench::model {

template <class T>
struct OscillatorOf {
  T mass = 1;                                             // kg
  T damping = 0;                                          // c, N s/m
  T stiffness = 1;                                        // k, N/m
  T frequency() const { return sqrt(stiffness / mass); }  // undamped, rad/s
};
using Oscillator = OscillatorOf<double>;

template <class T>
struct MotionOf {
  T position = 0;  // m
  T velocity = 0;  // m/s
};
using Motion = MotionOf<double>;

// The motion that a force `f` rising at `rate` [N/s] leaves when all ringing has gone.
template <class T>
MotionOf<T> steady(const OscillatorOf<T>& o, const std::type_identity_t<T>& f,
                   const std::type_identity_t<T>& rate) {
  return {(f - o.damping * rate / o.stiffness) / o.stiffness, rate / o.stiffness};
}

template <class T>
MotionOf<T> swing(const OscillatorOf<T>& o, const MotionOf<T>& from, const std::type_identity_t<T>& f0,
                  const std::type_identity_t<T>& f1, const std::type_identity_t<T>& h) {
  if (h <= 0) return from;
  const T rate = (f1 - f0) / h;
  const MotionOf<T> before = steady(o, f0, rate), after = steady(o, f1, rate);
  const T e = from.position - before.position, v = from.velocity - before.velocity;
  // With g = c / 2m: cosine = e^-gh cos(wh), sine = e^-gh sin(wh) / w, or their hyperbolic kin.
  const T g = 0.5 * o.damping / o.mass, square = o.stiffness / o.mass;
  const T difference = square - g * g, w = sqrt(abs(difference));
  T cosine = 0, sine = 0;
  if (w * h < 1e-4) {
    cosine = exp(-g * h);
    sine = h * cosine;
  } else if (difference > 0) {
    cosine = exp(-g * h) * cos(w * h);
    sine = exp(-g * h) * sin(w * h) / w;
  } else {
    // The slow root as a quotient, for g - w would cancel.
    const T slow = exp(-square / (g + w) * h), fast = exp(-(g + w) * h);
    cosine = 0.5 * (slow + fast);
    sine = 0.5 * (slow - fast) / w;
  }
  return {after.position + e * (cosine + g * sine) + v * sine,
          after.velocity + v * (cosine - g * sine) - square * e * sine};
}

}  // namespace ferrobench::model
