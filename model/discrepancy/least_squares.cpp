#include "model/discrepancy/least_squares.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::model::discrepancy {
namespace {

// Slopes are taken over differences that change the residual by so much, far above the noise of a solver that
// chooses its steps, and far below where a switching or a ringing specimen is no longer linear.
constexpr double response = 100, least_difference = 0.002;
constexpr int most_rounds = 4;
constexpr double hardly = 1e-7;  // damped: directions that only priors hold go all the way
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

void make_columns(const Misfit& misfit, Fit& fit, Eigen::Index from) {
  const auto n = fit.z.size();
  std::vector<std::pair<const Hypothesis*, Eigen::VectorXd>> places;
  std::vector<double> steps;
  for (Eigen::Index i = from; i < n; ++i) {
    const auto& c = fit.hypothesis.coordinates[static_cast<std::size_t>(i)];
    double difference = c.difference;
    if (i < fit.jacobian.cols())
      difference = std::clamp(response / fit.jacobian.col(i).norm(), std::min(least_difference, difference),
                              difference);
    auto up = fit.z, down = fit.z;
    up[i] = std::min(c.high, up[i] + difference);
    down[i] = std::max(c.low, down[i] - difference);
    steps.push_back(up[i] - down[i]);
    places.emplace_back(&fit.hypothesis, std::move(up));
    places.emplace_back(&fit.hypothesis, std::move(down));
  }
  const auto moved = misfit.residuals(places);
  fit.jacobian.conservativeResize(misfit.size(), n);
  for (std::size_t i = 0; i < steps.size(); ++i)
    fit.jacobian.col(from + static_cast<Eigen::Index>(i)) = (moved[2 * i] - moved[2 * i + 1]) / steps[i];
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

Eigen::VectorXd Fit::corrected(Eigen::VectorXd simulated) const {
  if (correction.size() > 0) simulated += correction;
  return simulated;
}

void correct(const Misfit& misfit, const Misfit& fine, Fit& fit) {
  auto exact = fine.residuals(fit.hypothesis, fit.z);
  fit.correction = exact - misfit.residuals(fit.hypothesis, fit.z);
  fit.residual = std::move(exact);
  fit.squares = fit.residual.squaredNorm() + priors(fit.hypothesis, fit.z);
}

void refresh(const Misfit& misfit, Fit& fit) {
  make_columns(misfit, fit, 0);
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
    make_columns(misfit, out, like->jacobian.cols());
  } else {
    refresh(misfit, out);
    ++refreshes;
  }
  double damping = limits.damping, gained = 0;
  for (int i = 0; i < limits.iterations; ++i) {
    if (limits.tick) limits.tick();
    const Eigen::MatrixXd normal = out.normal();
    const Eigen::VectorXd gradient = out.gradient();
    Eigen::MatrixXd damped = normal;
    damped.diagonal() *= 1 + damping;
    Eigen::VectorXd step = -damped.ldlt().solve(gradient);
    // No further at once than the model may be trusted to be nearly linear.
    if (const double longest = step.cwiseAbs().maxCoeff(); longest > 4) step *= 4 / longest;
    const Eigen::VectorXd next = within(hypothesis, out.z + step);
    step = next - out.z;
    const double promised = -(2 * gradient.dot(step) + step.dot(normal * step));
    auto residual = out.corrected(misfit.residuals(hypothesis, next));
    const double squares = residual.squaredNorm() + priors(hypothesis, next);
    const double gain = out.squares - squares;
    if (const double length = step.squaredNorm(); length > 1e-12) {
      // What the Jacobian did not foresee, it learns.
      if (gain > 0 || promised < 1e3 * std::abs(gain))
        out.jacobian += (residual - out.residual - out.jacobian * step) * (step / length).transpose();
    }
    const bool was_fresh = out.fresh;
    if (gain > 0) {
      out.z = next;
      out.residual = std::move(residual);
      out.squares = squares;
      gained += gain;
    }
    out.fresh = false;
    damping = gain > 0.5 * promised ? damping * 0.2 : damping * (gain > 0 ? 1.5 : 8);
    const double enough = std::max(limits.enough, 1e-4 * gained);
    if (gain > std::max(enough, 0.25 * promised)) continue;
    if (gain >= 0 && gain <= enough && promised <= 4 * enough && (was_fresh || refreshes >= limits.refreshes))
      break;
    if (refreshes < limits.refreshes && !was_fresh) {
      refresh(misfit, out);
      ++refreshes;
      damping = std::min(damping, 1e-2);
    } else if (promised < enough || damping > 1e5) {
      break;
    }
  }
  return out;
}

void settle(const Misfit& misfit, const Misfit& fine, Fit& f, const std::function<void()>& tick) {
  correct(misfit, fine, f);
  f = fit(misfit, f.hypothesis, f.z,
          {.iterations = 12, .refreshes = 2, .enough = 1, .damping = hardly, .tick = tick}, &f);
  refresh(misfit, f);
  if (f.squares < worth_the_last_steps * static_cast<double>(misfit.size())) {
    // The last steps by the fine simulation itself, with the usual one's slopes and what they learn on the
    // way.
    for (int round = 0; round < most_rounds; ++round) {
      const double before = f.squares;
      f.correction.resize(0);
      f = fit(fine, f.hypothesis, f.z,
              {.iterations = 6, .refreshes = 0, .enough = 0.5, .damping = hardly, .tick = tick}, &f);
      correct(misfit, fine, f);
      refresh(misfit, f);
      if (before - f.squares < 2) break;
    }
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
