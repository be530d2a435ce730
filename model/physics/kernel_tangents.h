// Forward sensitivities of a step of the kernel: what small changes of constants, loads and internal loads do
// to the phase fractions of all domains and to their means.
//
// The end x' of a row's step depends on its start x and on the intensities I_j of the four transitions
// (kernel.h), these on ln(rate) at both ends of the step, on the bend and on h / tau. For a direction p
//
//     dx'/dp = A dx/dp + sum over k of J_k c_kp,   A = dx'/dx (2 x 2),   J_k = dx'/d(cause k) (2)
//
// A and J are computed once per row and step and serve all directions; the exponentials are those that the
// step has already taken. A direction says only by how much, c_kp, it moves each cause.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "model/physics/kernel.h"

namespace ferrobench::model {

// What a step depends on, and the unit of its coefficients.
enum class Cause {
  field_before,   // V/m, at the step's start
  field_after,    // at its end
  stress_before,  // Pa
  stress_after,
  bend,                 // Pa, of the stress at mid-step
  polarization_before,  // C/m^2, P_+ of the rates at the start
  polarization_after,
  strain_90,            // 1
  piezoelectric,        // m/V
  half_permittivity,    // F/m
  half_compliance,      // 1/Pa
  log_energy,           // ln(V / kT)
  log_span,             // ln(h / tau)
  stabilization,        // 1/Pa
  asymmetry,            // 1, barrier_asymmetry
  log_direct_rate,      // ln(direct_rate)
  direct_barrier,       // 1
  log_barrier,          // ln(dg0)
  barrier_log_std,      // 1, as log_barrier times q1
  internal_field,       // V/m, at both ends
  internal_field_std,   // times q2
  internal_stress_std,  // Pa, times q3, at both ends
  skewness,             // 1, of the barriers' spread
  inverse_freedom       // 1, of all spreads
};
inline constexpr std::size_t cause_count = 24;
using Causes = std::array<double, cause_count>;

struct TangentStep {
  double h = 0;  // s
  LoadPath path;
  double polarization_before = 0;  // P_+ of the rates before
  RateColumns before, after;
  // Of the spreads, one per row (domains.h).
  std::array<const double*, 3> quantile{}, by_inverse_freedom{};
  const double* by_skewness = nullptr;
};

// Tangents of the fractions in one direction; both columns padded as DomainColumns are.
struct FractionTangents {
  double* plus = nullptr;
  double* minus = nullptr;
  const Causes* causes = nullptr;
  bool fresh = false;  // zero at the start of the step, whatever the columns hold
};

// Tangents of the means in one direction; rates times tau.
struct MeanTangents {
  double plus = 0, minus = 0, plus_rate = 0, minus_rate = 0;
};

// Moves the tangents of the first `count` rows from the step's start to its end; `out` has one entry per
// direction. `domains` holds the fractions at the start, k those constants that the step was made with.
void step_tangents(const KineticConstants& k, const DomainColumns& domains, std::size_t count,
                   const TangentStep& step, const std::vector<FractionTangents>& directions,
                   std::vector<MeanTangents>& out);

}  // namespace ferrobench::model
