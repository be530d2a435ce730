// The inner loop of the model: transition rates and phase fractions of many domains over one step.
//
// Vector code for the processor it runs on is chosen at run time; every choice agrees to 1e-12.
//
// A step of h seconds takes the logarithm of each rate as linear in time between its two ends, so each transition's
// intensity (integral of the rate) is h (r1 - r0) / ln(r1 / r0). With the intensities a (+ -> 90), b (90 -> +),
// c (90 -> -), d (- -> 90) the fractions follow from the exact exponential of the two-state system (4.21). Exact for
// constant loads; otherwise second order, with an error constant that is small because the logarithms are nearly linear.
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

// + -> 90, 90 -> +, 90 -> -, - -> 90
struct RateColumns {
  std::array<double*, 4> log_rate{};  // ln(tau r)
  std::array<double*, 4> rate{};      // tau r
};

struct StepResult {
  double plus = 0, minus = 0;              // sum of weight x at the end
  double plus_rate = 0, minus_rate = 0;  // sum of weight dx/dt at the end, 1/s
};

struct StepOutput {
  double* plus = nullptr;
  double* minus = nullptr;
  double* outflow = nullptr;  // tau times the gross flow out of all wells that hold more than `negligible`
  double negligible = 0;
};

void evaluate_rates(const KineticConstants& k, const DomainColumns& domains, std::size_t count, const Loads& at,
                    const RateColumns& out);

// From rates `before` (at the start) to loads `at` (at the end), whose rates go to `after`.
StepResult step_domains(const KineticConstants& k, const DomainColumns& domains, std::size_t count, double h,
                        const Loads& at, const RateColumns& before, const RateColumns& after, const StepOutput& out);

// The same with the loads unchanged: `before` holds at both ends.
StepResult step_domains_held(const KineticConstants& k, const DomainColumns& domains, std::size_t count, double h,
                             const RateColumns& before, const StepOutput& out);

// Names of the vector instruction sets that this program holds code for and this processor has; the first is in use.
std::vector<std::string> kernel_targets();
// For tests: use only the named one, or "" for the best.
void force_kernel_target(const std::string& name);

}  // namespace ferrobench::model
