#include "model/inference/solver/gauss_newton.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace ferrobench::model::inference {
namespace {

// Slopes are taken over differences that change the residual by so much, far above the noise of a solver that
// chooses its steps, and far below where a switching or a ringing specimen is no longer linear.
constexpr double response = 100, least_difference = 0.002;
// The curvature along a step is measured so far to both sides of the fit, in prior standard deviations.
constexpr double look_ahead = 0.3;
// A solution goes on while so many times what is enough is predicted to be gained.
constexpr double hope = 10;

Eigen::VectorXd within(const Hypothesis& h, Eigen::VectorXd z) {
  for (Eigen::Index i = 0; i < z.size(); ++i) {
    const auto& c = h.parameters[static_cast<std::size_t>(i)];
    z[i] = std::clamp(z[i], c.low, c.high);
  }
  return z;
}

void make_columns(const WhitenedResiduals& residuals, Fit& fit, Eigen::Index from, bool roughly) {
  const auto n = fit.z.size();
  std::vector<std::pair<const Hypothesis*, Eigen::VectorXd>> places;
  std::vector<double> steps;
  for (Eigen::Index i = from; i < n; ++i) {
    const auto& c = fit.hypothesis.parameters[static_cast<std::size_t>(i)];
    double difference = c.difference;
    if (i < fit.jacobian.cols())
      difference = std::clamp(response / fit.jacobian.col(i).norm(), std::min(least_difference, difference),
                              difference);
    auto one = fit.z, other = fit.z;
    one[i] = std::min(c.high, one[i] + difference);
    if (!roughly || one[i] == fit.z[i]) other[i] = std::max(c.low, other[i] - difference);
    steps.push_back(one[i] - other[i]);
    places.emplace_back(&fit.hypothesis, std::move(one));
    places.emplace_back(&fit.hypothesis, std::move(other));
  }
  const auto moved = residuals.evaluate(places);
  fit.jacobian.conservativeResize(residuals.size(), n);
  for (std::size_t i = 0; i < steps.size(); ++i)
    fit.jacobian.col(from + static_cast<Eigen::Index>(i)) = (moved[2 * i] - moved[2 * i + 1]) / steps[i];
}

// How the residual changes along a step: r(t) = r + t slope + t^2 curve / 2.
struct Along {
  Eigen::VectorXd slope, curve;
};

// Measured on both sides; the Jacobian learns the slope.
Along look_along(const WhitenedResiduals& residuals, Fit& fit, const Eigen::VectorXd& step) {
  const double far = std::min(1.0, look_ahead / step.cwiseAbs().maxCoeff());
  const auto up = within(fit.hypothesis, fit.z + far * step),
             down = within(fit.hypothesis, fit.z - far * step);
  const Eigen::VectorXd between = up - down;
  const double length = between.squaredNorm();
  Along out{.slope = fit.jacobian * step, .curve = Eigen::VectorXd::Zero(residuals.size())};
  const auto there = residuals.evaluate({{&fit.hypothesis, up}, {&fit.hypothesis, down}});
  const Eigen::VectorXd change = there[0] - there[1];
  if (WhitenedResiduals::is_unsolved(change) || length < 1e-12) return out;
  fit.jacobian += (change - fit.jacobian * between) * (between / length).transpose();
  if ((between - 2 * far * step).squaredNorm() > 1e-6 * length) return out;  // at the end of a range
  out.slope = change / (2 * far);
  out.curve = (fit.corrected(there[0]) + fit.corrected(there[1]) - 2 * fit.residual) / (far * far);
  return out;
}

struct Step {
  Eigen::VectorXd change;          // of z
  double promised = 0, hoped = 0;  // gain of the sum of squares; without bends
  double share = 0;                // of Levenberg's step
};

// Levenberg's step, bent as the valley is and as long as promises most.
Step next_step(const WhitenedResiduals& residuals, Fit& fit, double damping) {
  const Eigen::MatrixXd normal = fit.normal();
  const Eigen::VectorXd gradient = fit.gradient();
  Eigen::MatrixXd damped = normal;
  damped.diagonal() *= 1 + damping;
  const auto factor = damped.ldlt();
  Eigen::VectorXd step = -factor.solve(gradient);
  // No further at once than the model may be trusted to be nearly linear.
  if (const double longest = step.cwiseAbs().maxCoeff(); longest > 4) step *= 4 / longest;
  const auto along = look_along(residuals, fit, step);
  // Where it would bend far, in directions that the data leave open, it is made to bend less.
  const Eigen::VectorXd pull = fit.jacobian.transpose() * along.curve;
  Eigen::VectorXd aside = -0.5 * factor.solve(pull);
  double stiff = 1;
  while (aside.cwiseAbs().maxCoeff() > 0.5 * step.cwiseAbs().maxCoeff()) {
    aside = -0.5 * (damped + stiff * Eigen::MatrixXd::Identity(step.size(), step.size())).ldlt().solve(pull);
    stiff *= 10;
  }
  const Eigen::VectorXd bend = 0.5 * along.curve + fit.jacobian * aside;
  const double first = 2 * fit.residual.dot(along.slope),
               second = along.slope.squaredNorm() + 2 * fit.residual.dot(bend),
               third = 2 * along.slope.dot(bend), fourth = bend.squaredNorm();
  const double before = prior_squares(fit.hypothesis, fit.z);
  Step out{.change = Eigen::VectorXd::Zero(step.size()),
           .hoped = -(2 * gradient.dot(step) + step.dot(normal * step))};
  for (int k = 0; k < 31; ++k) {
    const double t = 1.5 * std::pow(0.85, k);  // to 0.01
    const Eigen::VectorXd change = t * step + t * t * aside;
    const double gain = before - prior_squares(fit.hypothesis, fit.z + change) -
                        t * (first + t * (second + t * (third + t * fourth)));
    if (gain > out.promised) out = {change, gain, out.hoped, t};
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
  const Eigen::VectorXd pull = gradient();
  return pull.dot(normal().ldlt().solve(pull));
}

Eigen::VectorXd Fit::corrected(Eigen::VectorXd simulated) const {
  if (fidelity_correction.size() > 0) simulated += fidelity_correction;
  return simulated;
}

void refresh_jacobian(const WhitenedResiduals& residuals, Fit& fit, bool roughly) {
  make_columns(residuals, fit, 0, roughly);
  fit.fresh = true;
}

Fit minimize(const WhitenedResiduals& residuals, const Hypothesis& hypothesis, const Eigen::VectorXd& z,
             const SolverOptions& options, const Fit* warm_start) {
  Fit out{.hypothesis = hypothesis,
          .z = within(hypothesis, z),
          .residual = {},
          .fidelity_correction = warm_start != nullptr ? warm_start->fidelity_correction : Eigen::VectorXd(),
          .jacobian = {}};
  out.residual = out.corrected(residuals.evaluate(hypothesis, out.z));
  out.squares = out.residual.squaredNorm() + prior_squares(hypothesis, out.z);
  int refreshes = 0;
  if (warm_start != nullptr) {
    out.jacobian = warm_start->jacobian;
    make_columns(residuals, out, warm_start->jacobian.cols(), options.roughly);
  } else {
    refresh_jacobian(residuals, out, options.roughly);
    ++refreshes;
  }
  double damping = options.damping, gained = 0;
  for (int i = 0; i < options.iterations; ++i) {
    if (options.tick) options.tick();
    const auto next = next_step(residuals, out, damping);
    const bool was_fresh = std::exchange(out.fresh, false);
    double gain = 0;
    if (next.promised > 0) {
      auto to = within(hypothesis, out.z + next.change);
      const Eigen::VectorXd step = to - out.z;
      auto residual = out.corrected(residuals.evaluate(hypothesis, to));
      const double squares = residual.squaredNorm() + prior_squares(hypothesis, to),
                   length = step.squaredNorm();
      gain = out.squares - squares;
      // What the Jacobian did not foresee, it learns.
      if (length > 1e-12 && (gain > 0 || next.promised < 1e3 * std::abs(gain)))
        out.jacobian += (residual - out.residual - out.jacobian * step) * (step / length).transpose();
      if (gain > 0) {
        out.z = std::move(to);
        out.residual = std::move(residual);
        out.squares = squares;
        gained += gain;
      }
    }
    damping *= gain <= 0 ? 8 : gain < 0.5 * next.promised || next.share < 0.5 ? 2 : 0.2;
    const double enough = std::max(options.enough, 1e-4 * gained);
    if (gain > std::max(enough, 0.25 * next.promised)) continue;
    if (std::max(next.promised, next.hoped) <= hope * enough) break;
    if (refreshes < options.refreshes && !was_fresh) {
      refresh_jacobian(residuals, out, options.roughly);
      ++refreshes;
      damping = std::min(damping, 1e-2);
    } else if (damping > 1e5) {
      break;
    }
  }
  return out;
}

}  // namespace ferrobench::model::inference
