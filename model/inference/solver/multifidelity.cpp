#include "model/inference/solver/multifidelity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

namespace ferrobench::model::inference {
namespace {

// Corrections are made anew, and an anchor is moved, so many times at most.
constexpr int most_rounds = 4, most_anchors = 3;
// What twice the nodes take off the squares, to guess how many are enough: of four benches of the campaign, a
// factor of 2 to 27, mostly 3 to 13. What the guess leads to is looked at as well.
constexpr double squares_per_doubling = 8;
// Around an anchor the error of a quarter of the nodes was 0.1 to 30 of the sum of squares on four benches of
// the campaign, and 45 to 160 for explanations far away, where the anchor is moved; without it up to 620.
constexpr int cheaper = 4;
// Damping that lets directions that only priors hold go all the way.
constexpr double hardly_damped = 1e-7;
// A round that gains less than this, or than this share of the sum of squares, was the last one.
constexpr double last_gain = 5, last_share = 1e-3;
// Where the coarse minimum lies so far from where the correction was made that the fine simulation gains
// nothing there, this part of the way is gone, and that part of it once more: at the place of the correction
// both simulations agree.
constexpr double part_of_way = 0.25;
constexpr int most_shortened = 2;

// Root mean square of weighed residuals, by the rows that are independent of each other.
double root_mean_square(double squares, const WhitenedResiduals& residuals) {
  return std::sqrt(squares / std::max(1.0, residuals.samples()));
}

}  // namespace

double coarse_error_at(const WhitenedResiduals& coarse, const Eigen::VectorXd& exact,
                       const Hypothesis& hypothesis, const Eigen::VectorXd& z) {
  return root_mean_square((coarse.evaluate(hypothesis, z) - exact).squaredNorm(), coarse);
}

ConvergedFidelity choose_fidelities(WhitenedResiduals& coarse, WhitenedResiduals& fine,
                                    const Hypothesis& hypothesis, const Eigen::VectorXd& z, int most_domains,
                                    const AllowedError& allowed) {
  auto converged = converge_fine_fidelity(fine, hypothesis, z, most_domains, allowed.fine);
  // Of the nodes that are to serve every spread, the base has a third.
  const bool every_spread = fine.simulation().every_spread;
  struct Choice {
    int count = 0;
    double tolerance = 0;
  };
  constexpr std::array choices{Choice{250, 1e-4},  Choice{500, 1e-4},  Choice{1000, 1e-4},
                               Choice{1000, 1e-5}, Choice{2000, 1e-4}, Choice{2000, 1e-5},
                               Choice{4000, 1e-4}, Choice{4000, 1e-5}};
  std::optional<SimulationOptions> chosen;
  for (const auto& [count, tolerance] : choices) {
    coarse.simulate_by(
        {.tolerance = tolerance, .domains = (every_spread ? 4 : 1) * count, .every_spread = every_spread});
    const double off = coarse_error_at(coarse, converged.residual, hypothesis, z);
    if (!chosen && off < allowed.coarse) chosen = coarse.simulation();
    if (off < std::min(allowed.coarse, last_steps_error)) break;
  }
  fine.make_last_steps_by(coarse.simulation());
  if (chosen) coarse.simulate_by(*chosen);
  return converged;
}

namespace {

// Residuals by the simulation as it stands, and the sum of squares of their error.
std::pair<Eigen::VectorXd, double> with_error(WhitenedResiduals& fine, const Hypothesis& hypothesis,
                                              const Eigen::VectorXd& z) {
  const auto simulation = fine.simulation();
  auto residual = fine.evaluate(hypothesis, z);
  // The errors of the two lattices are independent, so each has half of the squares.
  auto other = simulation;
  other.shift = 3;
  fine.simulate_by(other);
  const double squares = (fine.evaluate(hypothesis, z) - residual).squaredNorm() / 2;
  fine.simulate_by(simulation);
  return {std::move(residual), squares};
}

}  // namespace

ConvergedFidelity converge_fine_fidelity(WhitenedResiduals& fine, const Hypothesis& hypothesis,
                                         const Eigen::VectorXd& z, int most_domains, double most_error) {
  const bool anchored = fine.is_anchored();
  const double enough = std::max(unnoticed_change, most_error * most_error * fine.samples());
  for (;;) {
    auto [residual, squares] = with_error(fine, hypothesis, z);
    if (squares >= enough && fine.is_anchored()) {
      fine.release();
      continue;
    }
    auto simulation = fine.simulation();
    if (squares < enough || 2 * simulation.domains > most_domains) {
      if (anchored && !fine.is_anchored()) anchor_fine_fidelity(fine, hypothesis, z, residual);
      return {std::move(residual), root_mean_square(squares, fine)};
    }
    do {
      simulation.domains *= 2;
      squares /= squares_per_doubling;
    } while (squares >= enough && 2 * simulation.domains <= most_domains);
    fine.simulate_by(simulation);
  }
}

void anchor_fine_fidelity(WhitenedResiduals& fine, const Hypothesis& hypothesis, const Eigen::VectorXd& z,
                          Eigen::VectorXd residual) {
  fine.anchor(hypothesis, z, std::move(residual));
  auto simulation = fine.simulation();
  const int enough = std::max({least_fine_domains, simulation.domains / cheaper, fine.last_steps().domains});
  simulation.domains = std::min(simulation.domains, enough);
  fine.simulate_by(simulation);
}

namespace {

void set_residual(Fit& fit, Eigen::VectorXd exact) {
  fit.residual = std::move(exact);
  fit.squares = fit.residual.squaredNorm() + prior_squares(fit.hypothesis, fit.z);
}

}  // namespace

void apply_fidelity_correction(const WhitenedResiduals& coarse, Eigen::VectorXd exact, Fit& fit) {
  fit.fidelity_correction = exact - coarse.evaluate(fit.hypothesis, fit.z);
  set_residual(fit, std::move(exact));
}

void apply_fidelity_correction(const WhitenedResiduals& coarse, const WhitenedResiduals& fine, Fit& fit) {
  apply_fidelity_correction(coarse, fine.evaluate(fit.hypothesis, fit.z), fit);
}

namespace {

// Takes the fit to the place of `next` if less is left there; returns how much less.
double advance(Fit& fit, Fit next) {
  const double gain = fit.squares - next.squares;
  if (gain > 0) fit = std::move(next);
  return gain;
}

// From one minimum to the next until that gains nothing.
template <typename Next>
void advance_to_the_end(Fit& fit, const Next& next) {
  for (int round = 0; round < most_rounds; ++round) {
    const double gain = advance(fit, next(fit));
    if (gain < std::max(last_gain, last_share * fit.squares)) break;
  }
}

// The next minimum of the coarse simulation, with the correction that the fit has, or a place on the way to
// it (a trust region's step: Alexandrov et al.). Its residual is that of the fine simulation.
Fit next_corrected(const WhitenedResiduals& coarse, const WhitenedResiduals& fine, const Fit& fit,
                   const SolverOptions& options) {
  auto out = minimize(coarse, fit, options);
  const double promised = fit.squares - out.squares;
  Eigen::VectorXd way = out.z - fit.z;
  apply_fidelity_correction(coarse, fine, out);
  for (int i = 0; i < most_shortened && promised > last_gain && out.squares >= fit.squares; ++i) {
    way *= part_of_way;
    out.z = fit.z + way;
    out.fresh = false;
    apply_fidelity_correction(coarse, fine, out);
  }
  return out;
}

}  // namespace

void minimize_corrected(const WhitenedResiduals& coarse, const WhitenedResiduals& fine, Fit& fit,
                        const SolverOptions& options) {
  minimize_corrected(coarse, fine, fine.evaluate(fit.hypothesis, fit.z), fit, options);
}

void minimize_corrected(const WhitenedResiduals& coarse, const WhitenedResiduals& fine, Eigen::VectorXd exact,
                        Fit& fit, const SolverOptions& options) {
  apply_fidelity_correction(coarse, std::move(exact), fit);
  advance_to_the_end(fit, [&](const Fit& from) { return next_corrected(coarse, fine, from, options); });
}

namespace {

// The next minimum of the fine simulation, with steps by `steps`.
Fit next_by(const SimulationOptions& steps, WhitenedResiduals& fine, Fit from, const SolverOptions& options) {
  const auto exact = fine.simulation();
  fine.simulate_by(steps);
  from.fidelity_correction = from.residual - fine.evaluate(from.hypothesis, from.z);
  auto out = minimize(fine, std::move(from), options);
  fine.simulate_by(exact);
  set_residual(out, fine.evaluate(out.hypothesis, out.z));
  return out;
}

}  // namespace

void refine(const WhitenedResiduals& coarse, WhitenedResiduals& fine, Fit& f, LastSteps by,
            const std::function<void()>& tick) {
  const SolverOptions options{.iterations = 12, .enough = 1, .damping = hardly_damped, .tick = tick};
  auto steps = fine.last_steps();
  steps.domains = std::min(steps.domains, fine.simulation().domains);
  advance_to_the_end(f, [&](const Fit& from) { return next_by(steps, fine, from, options); });
  if (by == LastSteps::fine && steps.domains < fine.simulation().domains) {
    f.fresh = false;  // its slopes are those of fewer nodes
    f.fidelity_correction.resize(0);
    advance_to_the_end(f, [&](const Fit& from) { return minimize(fine, from, options); });
  }
  apply_fidelity_correction(coarse, f.residual, f);
  if (!f.fresh) refresh_jacobian(coarse, f);
}

void anchor_corrected(const WhitenedResiduals& coarse, WhitenedResiduals& fine, Fit& f,
                      const std::function<void()>& tick) {
  fine.release();
  apply_fidelity_correction(coarse, fine, f);
  advance(f, next_corrected(coarse, fine, f, {.iterations = 12, .enough = 1, .tick = tick}));
  if (!f.fresh) refresh_jacobian(coarse, f);
  anchor_fine_fidelity(fine, f.hypothesis, f.z, f.residual);
}

void refine_around_anchor(const WhitenedResiduals& coarse, WhitenedResiduals& fine, Fit& f,
                          const std::function<void()>& tick) {
  for (int round = 0; round < most_anchors; ++round) {
    refine(coarse, fine, f, LastSteps::fine, tick);
    const double around_anchor = f.squares;
    fine.release();
    apply_fidelity_correction(coarse, fine, f);
    anchor_fine_fidelity(fine, f.hypothesis, f.z, f.residual);
    if (std::abs(f.squares - around_anchor) < unnoticed_change) break;
  }
}

}  // namespace ferrobench::model::inference
