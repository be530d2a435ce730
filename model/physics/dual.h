// A number that carries tangents: its derivatives in `count` directions (forward mode, first order). What is
// written for a scalar type T gives the values with T = double and, from the same source, their derivatives
// with a Dual.
//
// Values are computed by the same operations in the same order as with double, and comparisons are those of
// the values. So every branch is taken by the values alone, and at a kink the slope is that of the branch
// taken.
#pragma once

#include <array>
#include <cmath>
#include <compare>
#include <cstddef>

namespace ferrobench::model {

template <std::size_t count>
struct Dual {
  double value = 0;
  std::array<double, count> tangent{};

  Dual() = default;
  Dual(double v) : value(v) {}  // NOLINT: a number is a Dual that does not move
  // f of this with its derivative `slope` there.
  Dual chain(double f, double slope) const {
    Dual out(f);
    for (std::size_t i = 0; i < count; ++i) out.tangent[i] = slope * tangent[i];
    return out;
  }

  Dual& operator+=(const Dual& b) {
    value += b.value;
    for (std::size_t i = 0; i < count; ++i) tangent[i] += b.tangent[i];
    return *this;
  }
  Dual& operator-=(const Dual& b) {
    value -= b.value;
    for (std::size_t i = 0; i < count; ++i) tangent[i] -= b.tangent[i];
    return *this;
  }
  Dual& operator+=(double b) {
    value += b;
    return *this;
  }
  Dual& operator-=(double b) {
    value -= b;
    return *this;
  }
  Dual& operator*=(const Dual& b) { return *this = *this * b; }

  friend Dual operator-(const Dual& a) { return a.chain(-a.value, -1); }
  friend Dual operator+(Dual a, const Dual& b) { return a += b; }
  friend Dual operator+(Dual a, double b) { return a += b; }
  friend Dual operator+(double a, const Dual& b) { return b.chain(a + b.value, 1); }
  friend Dual operator-(Dual a, const Dual& b) { return a -= b; }
  friend Dual operator-(Dual a, double b) { return a -= b; }
  friend Dual operator-(double a, const Dual& b) { return b.chain(a - b.value, -1); }
  friend Dual operator*(const Dual& a, const Dual& b) {
    Dual out(a.value * b.value);
    for (std::size_t i = 0; i < count; ++i) out.tangent[i] = a.tangent[i] * b.value + a.value * b.tangent[i];
    return out;
  }
  friend Dual operator*(const Dual& a, double b) { return a.chain(a.value * b, b); }
  friend Dual operator*(double a, const Dual& b) { return b.chain(a * b.value, a); }
  friend Dual operator/(const Dual& a, const Dual& b) {
    Dual out(a.value / b.value);
    const double inverse = 1 / b.value;
    for (std::size_t i = 0; i < count; ++i)
      out.tangent[i] = (a.tangent[i] - out.value * b.tangent[i]) * inverse;
    return out;
  }
  friend Dual operator/(const Dual& a, double b) { return a.chain(a.value / b, 1 / b); }
  friend Dual operator/(double a, const Dual& b) {
    const double quotient = a / b.value;
    return b.chain(quotient, -quotient / b.value);
  }

  friend bool operator==(const Dual& a, const Dual& b) { return a.value == b.value; }
  friend bool operator==(const Dual& a, double b) { return a.value == b; }
  friend auto operator<=>(const Dual& a, const Dual& b) { return a.value <=> b.value; }
  friend auto operator<=>(const Dual& a, double b) { return a.value <=> b; }

  friend Dual abs(const Dual& a) { return a.value < 0 ? -a : a; }
  friend Dual exp(const Dual& a) {
    const double e = std::exp(a.value);
    return a.chain(e, e);
  }
  friend Dual expm1(const Dual& a) { return a.chain(std::expm1(a.value), std::exp(a.value)); }
  friend Dual sin(const Dual& a) { return a.chain(std::sin(a.value), std::cos(a.value)); }
  friend Dual cos(const Dual& a) { return a.chain(std::cos(a.value), -std::sin(a.value)); }
  // At zero, where the slope has no bound, it is taken as zero.
  friend Dual sqrt(const Dual& a) {
    const double root = std::sqrt(a.value);
    return a.chain(root, root > 0 ? 0.5 / root : 0);
  }
  // At the origin, a kink, one-sided along both.
  friend Dual hypot(const Dual& a, const Dual& b) {
    Dual out(std::hypot(a.value, b.value));
    const double by_a = out.value > 0 ? a.value / out.value : 1,
                 by_b = out.value > 0 ? b.value / out.value : 1;
    for (std::size_t i = 0; i < count; ++i) out.tangent[i] = by_a * a.tangent[i] + by_b * b.tangent[i];
    return out;
  }
  friend Dual copysign(const Dual& a, const Dual& sign) {
    return std::signbit(a.value) == std::signbit(sign.value) ? a : -a;
  }
};

// So that unqualified calls find the functions of either type.
using std::abs;
using std::copysign;
using std::cos;
using std::exp;
using std::expm1;
using std::hypot;
using std::sin;
using std::sqrt;

inline double value_of(double v) {
  return v;
}
template <std::size_t count>
double value_of(const Dual<count>& v) {
  return v.value;
}

// Zero, and stays so whatever the parameters do.
inline bool vanishes(double v) {
  return v == 0;
}
template <std::size_t count>
bool vanishes(const Dual<count>& v) {
  return v.value == 0 && v.tangent == std::array<double, count>{};
}

// Whether numbers of type T carry tangents.
template <class T>
inline constexpr bool has_tangents = false;
template <std::size_t count>
inline constexpr bool has_tangents<Dual<count>> = true;

}  // namespace ferrobench::model
