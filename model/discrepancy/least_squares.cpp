#include "model/discrepancy/least_squares.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace ferrobench::model::discrepancy {
namespace {

// Slopes are taken over differences that change the residual by so much, far above the noise of a solver that
// chooses its steps, and far below where a switching or a ringing specimen is no longer linear.
constexpr double response = 100, least_difference = 0.002;
constexpr double look_ahead = 0.3;  // as far is looked to both sides of a fit, along its next step
constexpr double hope = 10;         // times what is enough: less is not worth going on for
constexpr int most_rounds = 4, coarser = 8;
constexpr double hardly = 1e-7;   // damped: directions that only priors hold go all the way
constexpr double unnoticed = 12;  // of the sum of squares, where 60 is something
// A sum of squares so many times its number is no minimum that anything is told from.
constexpr double worth_the_last_steps = 1.3;

double priors(const Hypothesis& h, const Eigen::VectorXd& z) {
  double sum = 0;
  for (Eigen::Index i = 0; i < z.size(); ++i)
    if (h.coordinates[static_cast<std::size_t>(i)].prior) sum += z[i] * z[i];
  return sum;
}

Eigen::VectorXd within(const Hypothesis& h, Eigen::VectorXd z) {
  for (Eigen::Index i = 0; i < z.size(); ++i) {
    const auto& c = h.coordinates[static_cast<std::size_t>(i)];
    z[i] = std::clamp(z[i], c.low, c.high);
  }
  return z;
}

void make_columns(const Misfit& misfit, Fit& fit, Eigen::Index from, bool roughly) {
  const auto n = fit.z.size();
  std::vector<std::pair<const Hypothesis*, Eigen::VectorXd>> places;
  std::vector<double> steps;
  for (Eigen::Index i = from; i < n; ++i) {
    const auto& c = fit.hypothesis.coordinates[static_cast<std::size_t>(i)];
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
  const auto moved = misfit.residuals(places);
  fit.jacobian.conservativeResize(misfit.size(), n);
  for (std::size_t i = 0; i < steps.size(); ++i)
    fit.jacobian.col(from + static_cast<Eigen::Index>(i)) = (moved[2 * i] - moved[2 * i + 1]) / steps[i];
}

// How the residual changes along a step: r(t) = r + t slope + t^2 curve / 2.
struct Along {
  Eigen::VectorXd slope, curve;
};

// Measured on both sides; the Jacobian learns the slope.
Along look_along(const Misfit& misfit, Fit& fit, const Eigen::VectorXd& step) {
  const double far = std::min(1.0, look_ahead / step.cwiseAbs().maxCoeff());
  const auto up = within(fit.hypothesis, fit.z + far * step),
             down = within(fit.hypothesis, fit.z - far * step);
  const Eigen::VectorXd between = up - down;
  const double length = between.squaredNorm();
  Along out{.slope = fit.jacobian * step, .curve = Eigen::VectorXd::Zero(misfit.size())};
  const auto there = misfit.residuals({{&fit.hypothesis, up}, {&fit.hypothesis, down}});
  const Eigen::VectorXd change = there[0] - there[1];
  if (Misfit::is_unsolved(change) || length < 1e-12) return out;
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
Step next_step(const Misfit& misfit, Fit& fit, double damping) {
  const Eigen::MatrixXd normal = fit.normal();
  const Eigen::VectorXd gradient = fit.gradient();
  Eigen::MatrixXd damped = normal;
  damped.diagonal() *= 1 + damping;
  const auto factor = damped.ldlt();
  Eigen::VectorXd step = -factor.solve(gradient);
  // No further at once than the model may be trusted to be nearly linear.
  if (const double longest = step.cwiseAbs().maxCoeff(); longest > 4) step *= 4 / longest;
  const auto along = look_along(misfit, fit, step);
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
  const double before = priors(fit.hypothesis, fit.z);
  Step out{.change = Eigen::VectorXd::Zero(step.size()),
           .hoped = -(2 * gradient.dot(step) + step.dot(normal * step))};
  for (int k = 0; k < 31; ++k) {
    const double t = 1.5 * std::pow(0.85, k);  // to 0.01
    const Eigen::VectorXd change = t * step + t * t * aside;
    const double gain = before - priors(fit.hypothesis, fit.z + change) -
                        t * (first + t * (second + t * (third + t * fourth)));
    if (gain > out.promised) out = {change, gain, out.hoped, t};
  }
  return out;
}

}  // namespace

Eigen::MatrixXd Fit::normal() const {
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(z.size(), z.size());
  a.selfadjointView<Eigen::Lower>().rankUpdate(jacobian.transpose());
  a = a.selfadjointView<Eigen::Lower>();
  for (Eigen::Index i = 0; i < z.size(); ++i)
    a(i, i) += hypothesis.coordinates[static_cast<std::size_t>(i)].prior ? 1.0 : 1e-9;
  return a;
}

Eigen::VectorXd Fit::gradient() const {
  Eigen::VectorXd b = jacobian.transpose() * residual;
  for (Eigen::Index i = 0; i < z.size(); ++i)
    if (hypothesis.coordinates[static_cast<std::size_t>(i)].prior) b[i] += z[i];
  return b;
}

double Fit::prospect() const {
  const Eigen::VectorXd pull = gradient();
  return pull.dot(normal().ldlt().solve(pull));
}

Eigen::VectorXd Fit::corrected(Eigen::VectorXd simulated) const {
  if (correction.size() > 0) simulated += correction;
  return simulated;
}

Refined refine(Misfit& fine, const Hypothesis& hypothesis, const Eigen::VectorXd& z, int most) {
  auto simulation = fine.simulation();
  for (;; simulation.domains *= 2) {
    fine.simulate_by(simulation);
    auto residual = fine.residuals(hypothesis, z);
    // Either is wrong by half of the squares.
    auto other = simulation;
    other.shift = 3;
    fine.simulate_by(other);
    const double squares = (fine.residuals(hypothesis, z) - residual).squaredNorm() / 2;
    fine.simulate_by(simulation);
    if (squares < unnoticed || 2 * simulation.domains > most)
      return {std::move(residual),
              std::sqrt(squares / static_cast<double>(std::max<Eigen::Index>(1, fine.size())))};
  }
}

void correct(const Misfit& misfit, Eigen::VectorXd exact, Fit& fit) {
  fit.correction = exact - misfit.residuals(fit.hypothesis, fit.z);
  fit.residual = std::move(exact);
  fit.squares = fit.residual.squaredNorm() + priors(fit.hypothesis, fit.z);
}

void correct(const Misfit& misfit, const Misfit& fine, Fit& fit) {
  correct(misfit, fine.residuals(fit.hypothesis, fit.z), fit);
}

void refresh(const Misfit& misfit, Fit& fit, bool roughly) {
  make_columns(misfit, fit, 0, roughly);
  fit.fresh = true;
}

Fit fit(const Misfit& misfit, const Hypothesis& hypothesis, const Eigen::VectorXd& z, const FitLimits& limits,
        const Fit* like) {
  Fit out{.hypothesis = hypothesis,
          .z = within(hypothesis, z),
          .residual = {},
          .correction = like != nullptr ? like->correction : Eigen::VectorXd(),
          .jacobian = {}};
  out.residual = out.corrected(misfit.residuals(hypothesis, out.z));
  out.squares = out.residual.squaredNorm() + priors(hypothesis, out.z);
  int refreshes = 0;
  if (like != nullptr) {
    out.jacobian = like->jacobian;
    make_columns(misfit, out, like->jacobian.cols(), limits.roughly);
  } else {
    refresh(misfit, out, limits.roughly);
    ++refreshes;
  }
  double damping = limits.damping, gained = 0;
  for (int i = 0; i < limits.iterations; ++i) {
    if (limits.tick) limits.tick();
    const auto next = next_step(misfit, out, damping);
    const bool was_fresh = std::exchange(out.fresh, false);
    double gain = 0;
    if (next.promised > 0) {
      auto to = within(hypothesis, out.z + next.change);
      const Eigen::VectorXd step = to - out.z;
      auto residual = out.corrected(misfit.residuals(hypothesis, to));
      const double squares = residual.squaredNorm() + priors(hypothesis, to), length = step.squaredNorm();
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
    const double enough = std::max(limits.enough, 1e-4 * gained);
    if (gain > std::max(enough, 0.25 * next.promised)) continue;
    if (std::max(next.promised, next.hoped) <= hope * enough) break;
    if (refreshes < limits.refreshes && !was_fresh) {
      refresh(misfit, out, limits.roughly);
      ++refreshes;
      damping = std::min(damping, 1e-2);
    } else if (damping > 1e5) {
      break;
    }
  }
  return out;
}

void settle(const Misfit& misfit, Misfit& fine, Fit& f, const std::function<void()>& tick) {
  f = fit(misfit, f.hypothesis, f.z,
          {.iterations = 12, .refreshes = 2, .enough = 1, .damping = hardly, .tick = tick}, &f);
  correct(misfit, fine, f);
  refresh(misfit, f);
  if (f.squares > worth_the_last_steps * static_cast<double>(misfit.size())) return;
  // The last steps by a simulation in between, with the usual one's slopes and what they learn on the way.
  const auto finest = fine.simulation();
  auto between = finest;
  between.domains = std::max(misfit.simulation().domains, finest.domains / coarser);
  for (int round = 0; round < most_rounds; ++round) {
    auto next = f;
    fine.simulate_by(between);
    correct(fine, f.residual, next);
    next = fit(fine, next.hypothesis, next.z,
               {.iterations = 6, .refreshes = 0, .enough = 0.5, .damping = hardly, .tick = tick}, &next);
    fine.simulate_by(finest);
    correct(misfit, fine, next);
    const double gain = f.squares - next.squares;
    if (gain > 0) f = std::move(next);
    if (gain < 5) break;
    refresh(misfit, f);
  }
}

Projection::Projection(const Fit& fit) : fit_(fit), factor_(fit.normal()), gradient_(fit.gradient()) {}

Eigen::VectorXd Projection::taken(const Eigen::VectorXd& r) const {
  return factor_.solve(fit_.jacobian.transpose() * r);
}

Drop Projection::drop(const Eigen::VectorXd& r) const {
  const Eigen::VectorXd shared = fit_.jacobian.transpose() * r;
  const Eigen::VectorXd solved = factor_.solve(shared);
  return {.along = -(r.dot(fit_.residual) - gradient_.dot(solved)),
          .across = std::max(0.0, r.squaredNorm() - shared.dot(solved))};
}

}  // namespace ferrobench::model::discrepancy
