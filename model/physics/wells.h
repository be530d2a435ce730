// The three wells at given field and stress, and what they give (4.16-4.24).
//
//   <P>_a   = P_a + kappa_a E + d_a sigma                                        C/m^2
//   <eps>_a = eps_a + s_a sigma + d_a E                                          1
//   g_a     = -1/2 kappa_a E^2 - d_a E sigma - 1/2 s_a sigma^2 - E P_a - sigma eps_a      J/m^3
//   F_a90   = g_a - g_90,  a = +, -     positive: the 90 well lies lower
//
// P_- = -P_+, d_- = -d_+, P_90 = d_90 = 0, eps_+ = eps_- = 0, eps_90 < 0. E in V/m, sigma in Pa, tension
// positive.
#pragma once

#include "model/model.h"
#include "model/physics/dual.h"

namespace ferrobench::model {

inline constexpr double boltzmann = 1.380649e-23;  // J/K

template <class T>
struct LoadsOf {
  T field = 0;   // V/m
  T stress = 0;  // Pa
};
using Loads = LoadsOf<double>;

template <class T>
struct DrivingForces {
  T plus_90 = 0;   // F_{+,90}, J/m^3
  T minus_90 = 0;  // F_{-,90}, J/m^3
};

// The constants of the kinetics in the form the kernel uses.
template <class T>
struct KineticConstantsOf {
  T polarization = 0;          // P_+, C/m^2
  T strain_90 = 0;             // eps_90
  T piezoelectric = 0;         // d_+, m/V
  T half_permittivity = 0;     // (kappa_180 - kappa_90) / 2, F/m
  T half_compliance = 0;       // (s_180 - s_90) / 2, 1/Pa
  T inverse_energy = 0;        // V / (k T), m^3/J
  T relaxation_time = 1;       // s
  T stress_stabilization = 0;  // 1/Pa, barrier of 90 -> +/-180 times (1 + this * max(0, -sigma))
  T barrier_asymmetry = 0;     // barriers towards + times exp(this), towards - times exp(-this)
  T direct_rate = 0;           // 1/tau times this are the rates of + <-> - without a barrier; 0: none
  T direct_barrier = 1;        // dg0 of + <-> - over that of the others
  BarrierLaw law = BarrierLaw::equal_curvature;
};
using KineticConstants = KineticConstantsOf<double>;

template <class T>
KineticConstantsOf<T> kinetic_constants(const MaterialOf<T>& m) {
  KineticConstantsOf<T> k;
  k.polarization = m.remanent_polarization;
  k.strain_90 = m.remanent_strain_90;
  k.piezoelectric = m.piezoelectric_180;
  k.half_permittivity = 0.5 * (m.permittivity_180 - m.permittivity_90);
  k.half_compliance = 0.5 * (m.compliance_180 - m.compliance_90);
  k.inverse_energy = m.activation_volume / (boltzmann * m.temperature);
  k.relaxation_time = m.relaxation_time;
  k.law = m.barrier_law;
  return k;
}

template <class T>
DrivingForces<T> driving_forces(const KineticConstantsOf<T>& k, const std::type_identity_t<LoadsOf<T>>& at) {
  const T even = -k.half_permittivity * at.field * at.field - k.half_compliance * at.stress * at.stress +
                 at.stress * k.strain_90;
  const T odd = at.field * (k.polarization + k.piezoelectric * at.stress);
  return {even - odd, even + odd};
}

}  // namespace ferrobench::model
