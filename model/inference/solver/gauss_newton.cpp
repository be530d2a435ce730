#include "model/inference/solver/gauss_newton.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "model/inference/solver/bounded_quadratic.h"

namespace ferrobench::model::inference {
namespace {

// The curvature along a step is measured so far ahead, in prior standard deviations: so near that the third
// derivative does not count, so far that the noise of the simulation's own steps does not.
constexpr double look_ahead = 0.5;
constexpr double most_damping = 1e5;
// After a step that failed.
constexpr double least_after_failure = 1e-3;
// A step that gains nothing is tried again at this share of its length. What a smooth residual then misses of
// the promise, terms of the third order in the length, is less than 0.02 of what it missed before. The
// steps of a simulation change from one place to the next, and with them its error, by as much at any
// distance: where more than this share is missed again, what is left to gain is less than that error.
constexpr double shorter = 0.25, missed_by_noise = 0.25;

Eigen::VectorXd within(const Hypothesis& h, Eigen::VectorXd z) {
  for (Eigen::Index i = 0; i < z.size(); ++i) {
    const auto& c = h.parameters[static_cast<std::size_t>(i)];
    z[i] = std::clamp(z[i], c.low, c.high);
  }
  return z;
}

// Makes the Jacobian's columns from one on at the fit's z. False if slopes cannot be had there: it is as
// before then.
bool make_columns(const WhitenedResiduals& residuals, Fit& fit, Eigen::Index from) {
  const auto made = residuals.slopes(fit.hypothesis, fit.z, from);
  if (!made) return false;
  fit.jacobian.conservativeResize(residuals.size(), fit.z.size());
  fit.jacobian.rightCols(made->cols()) = *made;
  return true;
}

// The second derivative of the residual along a step, from one simulation ahead.
Eigen::VectorXd curvature(const WhitenedResiduals& residuals, const Fit& fit, const Eigen::VectorXd& step,
                          const Eigen::VectorXd& slope) {
  const double far = std::min(1.0, look_ahead / step.cwiseAbs().maxCoeff());
  const Eigen::VectorXd there = within(fit.hypothesis, fit.z + far * step);
  Eigen::VectorXd out = Eigen::VectorXd::Zero(residuals.size());
  if ((there - fit.z - far * step).squaredNorm() > 1e-12 * step.squaredNorm()) return out;  // a range ends
  const auto simulated = residuals.evaluate(fit.hypothesis, there);
  if (WhitenedResiduals::is_unsolved(simulated)) return out;
  out = 2 * (fit.corrected(simulated) - fit.residual - far * slope) / (far * far);
  return out;
}

// The Gauss-Newton step between the ends of the parameters' ranges. `normal` may be damped.
Eigen::VectorXd step_within(const Fit& fit, const Eigen::MatrixXd& normal, const Eigen::VectorXd& gradient) {
  Eigen::VectorXd low(fit.z.size()), high(fit.z.size());
  for (Eigen::Index i = 0; i < fit.z.size(); ++i) {
    const auto& c = fit.hypothesis.parameters[static_cast<std::size_t>(i)];
    low[i] = std::min(0.0, c.low - fit.z[i]);
    high[i] = std::max(0.0, c.high - fit.z[i]);
  }
  return bounded_minimum(normal, gradient, low, high);
}

// Of the sum of squares by a full Gauss-Newton step, were the residual linear.
double decrease_by(const Fit& fit, const Eigen::MatrixXd& normal, const Eigen::VectorXd& gradient) {
  const Eigen::VectorXd step = step_within(fit, normal, gradient);
  return -step.dot(2 * gradient + normal * step);
}

bool may_reach(double squares, double wanted, double decrease) {
  return squares - decrease <= wanted;
}

// A parabola in the parameters' space, along Levenberg's step and bent as the valley is.
struct Curve {
  Eigen::VectorXd step, aside;
  // Of the sum of squares' residual part, without its value at the beginning.
  double first = 0, second = 0, third = 0, fourth = 0;

  Eigen::VectorXd at(double t) const { return t * step + t * t * aside; }
  double residual_squares(double t) const { return t * (first + t * (second + t * (third + t * fourth))); }
};

// A place on the curve.
struct Step {
  Eigen::VectorXd change;  // of z
  double promised = 0;     // gain of the sum of squares
  double share = 0;        // of Levenberg's step
};

Step step_at(const Fit& fit, const Curve& curve, double share) {
  Eigen::VectorXd change = curve.at(share);
  const double gain = prior_squares(fit.hypothesis, fit.z) - prior_squares(fit.hypothesis, fit.z + change) -
                      curve.residual_squares(share);
  return {std::move(change), gain, share};
}

// `normal` and `gradient` are the fit's.
Curve next_curve(const WhitenedResiduals& residuals, const Fit& fit, const Eigen::MatrixXd& normal,
                 const Eigen::VectorXd& gradient, double damping) {
  Eigen::MatrixXd damped = normal;
  damped.diagonal() *= 1 + damping;
  const auto factor = damped.ldlt();
  Eigen::VectorXd step = step_within(fit, damped, gradient);
  // No further at once than the model may be trusted to be nearly linear.
  if (const double longest = step.cwiseAbs().maxCoeff(); longest > 4) step *= 4 / longest;
  const Eigen::VectorXd slope = fit.jacobian * step, curve = curvature(residuals, fit, step, slope);
  // Where it would bend far, in directions that the data leave open, it is made to bend less.
  const Eigen::VectorXd pull = fit.jacobian.transpose() * curve;
  Eigen::VectorXd aside = -0.5 * factor.solve(pull);
  double stiff = 1;
  while (aside.cwiseAbs().maxCoeff() > 0.5 * step.cwiseAbs().maxCoeff()) {
    aside = -0.5 * (damped + stiff * Eigen::MatrixXd::Identity(step.size(), step.size())).ldlt().solve(pull);
    stiff *= 10;
  }
  const Eigen::VectorXd bend = 0.5 * curve + fit.jacobian * aside;
  return {.step = std::move(step),
          .aside = std::move(aside),
          .first = 2 * fit.residual.dot(slope),
          .second = slope.squaredNorm() + 2 * fit.residual.dot(bend),
          .third = 2 * slope.dot(bend),
          .fourth = bend.squaredNorm()};
}

// The place on the curve that promises most; a share of 0 where none promises anything.
Step best_step(const Fit& fit, const Curve& curve) {
  Step out{.change = Eigen::VectorXd::Zero(fit.z.size())};
  for (int k = 0; k < 31; ++k) {
    auto step = step_at(fit, curve, 1.5 * std::pow(0.85, k));  // to 0.01
    if (step.promised > out.promised) out = std::move(step);
  }
  return out;
}

// Goes there if the sum of squares is less, and returns by how much it is or would have been; minus infinity
// where the model cannot be solved.
double try_step(const WhitenedResiduals& residuals, Fit& fit, const Step& step) {
  auto to = within(fit.hypothesis, fit.z + step.change);
  auto simulated = residuals.evaluate(fit.hypothesis, to);
  if (WhitenedResiduals::is_unsolved(simulated)) return -std::numeric_limits<double>::infinity();
  auto residual = fit.corrected(std::move(simulated));
  const double squares = residual.squaredNorm() + prior_squares(fit.hypothesis, to);
  const double gain = fit.squares - squares;
  if (gain > 0) {
    fit.z = std::move(to);
    fit.residual = std::move(residual);
    fit.squares = squares;
  }
  return gain;
}

// To the minimum from a fit whose Jacobian was made there or, for the first step, near there.
Fit descend(const WhitenedResiduals& residuals, Fit out, const SolverOptions& options) {
  double damping = options.damping, gained = 0;
  // Along a bent valley a linear prediction promises what is not there, so a step that gains next to nothing,
  // or promises no more, ends the solution too.
  bool ended = false;
  for (int i = 0; i < options.iterations && damping < most_damping; ++i) {
    const double enough = std::max(options.enough, 1e-4 * gained);
    if (out.fresh && ended) break;
    const Eigen::MatrixXd normal = out.normal();
    const Eigen::VectorXd gradient = out.gradient();
    if (out.fresh) {
      const double decrease = decrease_by(out, normal, gradient);
      if (decrease < enough || !may_reach(out.squares, options.wanted, options.trusted_decrease * decrease))
        break;
    }
    if (options.tick) options.tick();
    const auto curve = next_curve(residuals, out, normal, gradient, damping);
    auto step = best_step(out, curve);
    const bool fresh = out.fresh;
    double gain = step.promised > 0 ? try_step(residuals, out, step) : 0;
    bool inconsistent = false;
    if (gain < 0) {
      const double missed = step.promised - gain;
      step = step_at(out, curve, shorter * step.share);
      gain = try_step(residuals, out, step);
      inconsistent = gain <= 0 && step.promised - gain > missed_by_noise * missed;
    }
    if (gain > 0) gained += gain;
    // By slopes of another place a step proves nothing about this one.
    ended = fresh && (inconsistent || (gain > 0 ? gain : step.promised) < enough);
    // Directions that only priors hold want next to no damping, so it falls fast where a step kept its
    // promise. A step that failed is made shorter by damping that shows.
    if (gain <= 0)
      damping = std::max(8 * damping, least_after_failure);
    else
      damping *= gain < 0.5 * step.promised || step.share < 0.5    ? 2
                 : gain > 0.9 * step.promised && step.share > 0.75 ? 0.02
                                                                   : 0.2;
    if (i + 1 == options.iterations) {
      out.fresh = out.fresh && gain <= 0;
    } else if ((gain > 0 || !out.fresh) && !refresh_jacobian(residuals, out)) {
      break;
    }
  }
  return out;
}

}  // namespace

double prior_squares(const Hypothesis& h, const Eigen::VectorXd& z) {
  double sum = 0;
  for (Eigen::Index i = 0; i < z.size(); ++i)
    if (h.parameters[static_cast<std::size_t>(i)].prior) sum += z[i] * z[i];
  return sum;
}

Eigen::MatrixXd Fit::normal() const {
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(z.size(), z.size());
  a.selfadjointView<Eigen::Lower>().rankUpdate(jacobian.transpose());
  a = a.selfadjointView<Eigen::Lower>();
  for (Eigen::Index i = 0; i < z.size(); ++i)
    a(i, i) += hypothesis.parameters[static_cast<std::size_t>(i)].prior ? 1.0 : 1e-9;
  return a;
}

Eigen::VectorXd Fit::gradient() const {
  Eigen::VectorXd b = jacobian.transpose() * residual;
  for (Eigen::Index i = 0; i < z.size(); ++i)
    if (hypothesis.parameters[static_cast<std::size_t>(i)].prior) b[i] += z[i];
  return b;
}

double Fit::predicted_decrease() const {
  return decrease_by(*this, normal(), gradient());
}

bool Fit::may_reach(double wanted, double trusted_decrease) const {
  return inference::may_reach(squares, wanted, trusted_decrease * predicted_decrease());
}

Eigen::VectorXd Fit::corrected(Eigen::VectorXd simulated) const {
  if (fidelity_correction.size() > 0) simulated += fidelity_correction;
  return simulated;
}

bool refresh_jacobian(const WhitenedResiduals& residuals, Fit& fit) {
  fit.fresh = make_columns(residuals, fit, 0);
  if (fit.jacobian.cols() != fit.z.size())
    fit.jacobian = Eigen::MatrixXd::Zero(residuals.size(), fit.z.size());
  return fit.fresh;
}

Fit minimize(const WhitenedResiduals& residuals, const Hypothesis& hypothesis, const Eigen::VectorXd& z,
             const SolverOptions& options, const Fit* warm_start) {
  Fit out{.hypothesis = hypothesis,
          .z = within(hypothesis, z),
          .residual = {},
          .fidelity_correction = warm_start != nullptr ? warm_start->fidelity_correction : Eigen::VectorXd(),
          .jacobian = {},
          .groups = residuals.groups()};
  out.residual = out.corrected(residuals.evaluate(hypothesis, out.z));
  out.squares = out.residual.squaredNorm() + prior_squares(hypothesis, out.z);
  const Eigen::Index columns = warm_start != nullptr ? warm_start->jacobian.cols() : 0;
  if (columns > 0 && columns < out.z.size()) {
    out.jacobian = warm_start->jacobian;
    if (!make_columns(residuals, out, columns)) {
      out.jacobian = Eigen::MatrixXd::Zero(residuals.size(), out.z.size());
      return out;
    }
    return descend(residuals, std::move(out), options);
  }
  if (warm_start != nullptr && warm_start->fresh && warm_start->z == out.z) {
    out.jacobian = warm_start->jacobian;
    out.fresh = true;
  }
  return minimize(residuals, std::move(out), options);
}

Fit minimize(const WhitenedResiduals& residuals, Fit from, const SolverOptions& options) {
  if (!from.fresh && !refresh_jacobian(residuals, from)) return from;
  return descend(residuals, std::move(from), options);
}

}  // namespace ferrobench::model::inference
