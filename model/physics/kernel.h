// The inner loop of the model: transition rates and phase fractions of many domains over one step.
//
// Vector code for the processor it runs on is chosen at run time; every choice agrees to 1e-12, or to 1e-11
// where barriers differ by polarity.
//
// A step of h seconds takes the logarithm of each rate as a parabola in time: its ends from the loads there,
// its bend from the barrier's curvature and from how far the loads at mid-step are off the line between the
// ends. With l = ln(rate), change D = l1 - l0 and a bend q u (1 - u), u in [0, 1], a transition's intensity
// (integral of the rate) is
//
//     h (m0 + q m1),   m0 = (r1 - r0) / D,   m1 = (r0 + r1 - 2 m0) / D^2        to first order in q
//
// With the intensities a (+ -> 90), b (90 -> +), c (90 -> -), e (- -> 90) the fractions x = (x+, x-) of the
// two-state system (4.21) change in a step by
//
//     psi(M) F,   psi(y) = (1 - exp(-y)) / y,   M = (a + b, b; c, c + e),   F = (b, c) - M x
//
// Where 180-degree wells switch into each other as well (KineticConstants::direct_rate), with the intensities
// p (+ -> -) and m (- -> +), M = (a + b + p, b - m; c - p, c + e + m). Their driving force is F_{+,90} -
// F_{-,90}, and since both have the same permittivity their barrier is that of equal curvature by any law.
//
// Where both ways of a pair are fast against the step, as a and b, the fractions follow the equilibrium of
// the rates, and their integrals would leave them at that of mid-step. There h times the rates at the end
// takes the place of the integral, by the share w / (1 + w), w = a b / 4: with equal ways that is how far the
// end of an exact step is from mid-step, in half steps, to 0.1 of them. Barriers of many kT have w of 1e-9
// and less, and the share is left out.
//
// psi is computed as a rational function of degrees 7 and 8, exact for y to infinity and nearly the best
// for all y >= 0 at once: off by 3.1e-8 of the change along an eigenvector of M, by 1.9e-7 of it at most
// where both eigenvalues meet. As it stands for psi and not for exp, that is a share of what flows in the
// step: where nothing flows nothing is lost, however many steps. Fractions are kept from leaving [0, 1] by as
// much. What else is left out, and only while loads move: the logarithm's third derivative, and the order in
// which transitions come within a step (their rates keep nearly constant ratios).
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "model/physics/wells.h"

namespace ferrobench::model {

// Columns of equal length, padded: loops may run to the next multiple of `padding` rows.
struct DomainColumns {
  static constexpr std::size_t padding = 8;
  const double* barrier = nullptr;          // J/m^3
  const double* inverse_barrier = nullptr;  // m^3/J
  const double* field = nullptr;            // E_int, V/m
  const double* stress = nullptr;           // sigma_int, Pa
  const double* weight = nullptr;
  const double* plus = nullptr;   // x+ at the start of the step
  const double* minus = nullptr;  // x-
};

// + -> 90, 90 -> +, 90 -> -, - -> 90, and with direct switching + -> -, - -> +
inline constexpr std::size_t most_transitions = 6;
inline std::size_t transition_count(const KineticConstants& k) {
  return k.direct_rate > 0 ? most_transitions : most_transitions - 2;
}
struct RateColumns {
  std::array<double*, most_transitions> log_rate{};  // ln(tau r)
  std::array<double*, most_transitions> rate{};      // tau r
};

struct StepResult {
  double plus = 0, minus = 0;            // sum of weight x at the end
  double plus_rate = 0, minus_rate = 0;  // sum of weight dx/dt at the end, 1/s
};

struct StepOutput {
  double* plus = nullptr;
  double* minus = nullptr;
  // tau times the gross flow out of all wells that hold more than `negligible`, apart by what makes it grow:
  // a falling field (+ -> 90, 90 -> -, + -> -) or a rising one (- -> 90, 90 -> +, - -> +).
  double* outflow_falling = nullptr;
  double* outflow_rising = nullptr;
  double negligible = 0;
};

void evaluate_rates(const KineticConstants& k, const DomainColumns& domains, std::size_t count,
                    const Loads& at, const RateColumns& out);

// Where the loads go in a step.
struct LoadPath {
  Loads from, to;
  Loads bend;  // loads at mid-step less the mean of both ends
};

// From rates `before` (those of path.from) to path.to, whose rates go to `after`.
StepResult step_domains(const KineticConstants& k, const DomainColumns& domains, std::size_t count, double h,
                        const LoadPath& path, const RateColumns& before, const RateColumns& after,
                        const StepOutput& out);

// The same with the loads unchanged: `before` holds at both ends.
StepResult step_domains_held(const KineticConstants& k, const DomainColumns& domains, std::size_t count,
                             double h, const RateColumns& before, const StepOutput& out);

// Names of the vector instruction sets that this program holds code for and this processor has; the first is
// in use.
std::vector<std::string> kernel_targets();
// For tests: use only the named one, or "" for the best.
void force_kernel_target(const std::string& name);

}  // namespace ferrobench::model
