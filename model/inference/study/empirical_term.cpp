#include "model/inference/study/empirical_term.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "model/inference/parameters/parameters.h"

namespace ferrobench::model::inference {
namespace {

constexpr double share_of_field = 0.05;
constexpr double farthest_weight = 12;  // in prior standard deviations
// Rounds of the fixed-point iteration for the width of the prior. With a linearized residual a round costs no
// simulation. Where a round is a fit, the width starts from the linearized one and changes little after two;
// the iteration ends once it changes by less than a tenth.
constexpr int rounds_linearized = 8, rounds_of_width = 3;
constexpr double settled_width = 0.1;
// Places of the time constant that are tried, between ten samples and the longest recording, of the
// logarithm.
constexpr std::array decades{0.25, 0.5, 0.75};

double largest_error(recordings::Channel channel, const std::vector<BenchRecording>& bench,
                     const std::vector<std::size_t>& chosen,
                     const std::vector<std::vector<NoiseModel>>& noise) {
  double out = 0;
  for (const std::size_t r : chosen)
    for (std::size_t c = 0; c < noise[r].size(); ++c)
      if (bench[r].channels[c].channel == channel) out = std::max(out, noise[r][c].model_error);
  return out;
}

double largest_field(const std::vector<BenchRecording>& bench) {
  double out = 0;
  for (const auto& r : bench) out = std::max(out, model::largest_field(r.knot_field));
  return out;
}

// By which the springs of `chosen` would be longer or shorter, as the force says or, without one, the
// displacement.
double extension_error(const std::vector<BenchRecording>& bench, const std::vector<std::size_t>& chosen,
                       const std::vector<std::vector<NoiseModel>>& noise) {
  double out = 0;
  for (const std::size_t r : chosen) {
    const double stiffness = bench[r].header.load.spring_stiffness;
    if (!(stiffness > 0)) continue;
    const double by_force = largest_error(recordings::Channel::force, bench, {r}, noise) / stiffness;
    out = std::max(
        out, by_force > 0 ? by_force : largest_error(recordings::Channel::displacement, bench, {r}, noise));
  }
  return out;
}

// As far as any spring went, by the range of what was measured, which holds the place of the start.
double largest_extension(const std::vector<BenchRecording>& bench) {
  double out = 0;
  for (const auto& r : bench) {
    const double stiffness = r.header.load.spring_stiffness;
    if (!(stiffness > 0)) continue;
    for (const auto& m : r.channels)
      if (m.channel == recordings::Channel::displacement)
        out = std::max(out, m.range);
      else if (m.channel == recordings::Channel::force)
        out = std::max(out, m.range / stiffness);
  }
  return out;
}

double log_determinant(const Eigen::MatrixXd& normal) {
  return Eigen::LDLT<Eigen::MatrixXd>(normal).vectorD().array().max(1e-300).log().sum();
}

// By which the weights' standard deviation has to be multiplied to be what they and their covariance say; the
// weights are the last numbers of the normal matrix.
double change_of_width(const Eigen::VectorXd& weights, const Eigen::MatrixXd& normal) {
  const Eigen::MatrixXd covariance = normal.inverse();
  const double undetermined = covariance.diagonal().tail(weights.size()).sum(),
               determined = static_cast<double>(weights.size()) - undetermined;
  return std::clamp(std::sqrt(weights.squaredNorm() / std::max(0.1, determined)), 0.1, 10.0);
}

// A fit with a term whose weights are zero, so that it does nothing yet; `slopes` are those of its weights.
Fit with_zero_weights(const Fit& without, const Effect& term, const std::vector<double>& fixed, double width,
                      const Eigen::MatrixXd& slopes) {
  Fit out = without;
  out.hypothesis = with_empirical(without.hypothesis, term, fixed, width);
  out.z = carried_over(out.hypothesis, without.hypothesis, without.z);
  out.jacobian.conservativeResize(Eigen::NoChange, out.z.size());
  out.jacobian.rightCols(slopes.cols()) = width * slopes;
  return out;
}

}  // namespace

std::vector<double> held_numbers(const Effect& term, const Model& model,
                                 const std::vector<BenchRecording>& bench,
                                 const std::vector<std::size_t>& chosen,
                                 const std::vector<std::vector<NoiseModel>>& noise) {
  using recordings::Channel;
  const auto& a = model.actuator;
  const double field = largest_field(bench);
  switch (term.family) {
    case Family::strain:
      return {largest_error(Channel::displacement, bench, chosen, noise) / a.length, field};
    case Family::polarization:
      return {largest_error(Channel::charge, bench, chosen, noise) /
                  (a.area * static_cast<double>(a.layer_count)),
              field};
    case Family::equilibrium:
      return {extension_error(bench, chosen, noise), largest_extension(bench)};
    default:
      return {share_of_field * field, field};
  }
}

Hypothesis with_empirical(const Hypothesis& h, const Effect& term, const std::vector<double>& fixed,
                          double width) {
  auto out = h;
  EffectSetting setting{.id = std::string(term.id), .parameters = {}};
  for (std::size_t i = 0; i < term.parameters.size(); ++i) {
    const auto& p = term.parameters[i];
    setting.parameters.emplace_back(p.name, i < fixed.size() ? fixed[i] : 0);
    if (i < fixed.size()) continue;
    out.parameters.push_back({.path = effect_path(term.id, p.name),
                              .from = 0,
                              .scale = width,
                              .logarithmic = false,
                              .low = -farthest_weight,
                              .high = farthest_weight});
  }
  out.model.effects.push_back(std::move(setting));
  return out;
}

LinearizedTerm linearize_term(const Effect& term, const WhitenedRecordings& residuals, const Fit& without,
                              std::vector<double> held, const LogLikelihoodRatio& log_likelihood_ratio) {
  LinearizedTerm best{.term = &term, .fixed = held, .slopes = {}};
  std::vector<double> time_constants;
  if (term.parameters[held.size()].unit == "s") {
    const auto [shortest, longest] = residuals.times();
    for (const double place : decades)
      time_constants.push_back(10 * shortest * std::pow(longest / (10 * shortest), place));
    held.push_back(0);
  }
  const double determinant_without = log_determinant(without.normal());
  const auto lags = std::ranges::count_if(
      term.parameters, [](const EffectParameter& p) { return p.name.starts_with("lag_"); });
  Eigen::MatrixXd slopes;
  for (std::size_t k = 0; k < std::max<std::size_t>(1, time_constants.size()); ++k) {
    if (!time_constants.empty()) held.back() = time_constants[k];
    const auto by_weights = with_empirical(without.hypothesis, term, held, 1);
    const auto zero = carried_over(by_weights, without.hypothesis, without.z);
    // Of the weights only those of the lags, the last ones, see the time constant.
    const auto first = slopes.size() == 0 ? without.z.size() : zero.size() - lags;
    const auto made = residuals.slopes(by_weights, zero, first);
    if (!made) continue;
    if (slopes.size() == 0) slopes.resize(made->rows(), made->cols());
    slopes.rightCols(made->cols()) = *made;
    double width = 1;
    for (int i = 0; i < rounds_linearized; ++i) {
      auto fit = with_zero_weights(without, term, held, width, slopes);
      const Eigen::MatrixXd normal = fit.normal();
      const Eigen::VectorXd step = -normal.ldlt().solve(fit.gradient());
      fit.z += step;
      fit.residual += fit.jacobian * step;
      fit.squares = fit.residual.squaredNorm() + prior_squares(fit.hypothesis, fit.z);
      const double evidence = log_likelihood_ratio(fit) - (log_determinant(normal) - determinant_without);
      if (evidence > best.evidence) {
        best.fixed = held;
        best.width = width;
        best.evidence = evidence;
        best.slopes = slopes;
      }
      width *= change_of_width(fit.z.tail(slopes.cols()), normal);
    }
  }
  return best;
}

TriedTerm fit_empirical(const WhitenedRecordings& residuals, const Fit& without,
                        const LinearizedTerm& at_zero, const LogLikelihoodRatio& log_likelihood_ratio,
                        const SolverOptions& solver) {
  TriedTerm best{.term = at_zero.term, .fit = {}};
  const double determinant_without = log_determinant(without.normal());
  double width = at_zero.width;
  auto from = with_zero_weights(without, *at_zero.term, at_zero.fixed, width, at_zero.slopes);
  for (int i = 0; i < rounds_of_width; ++i) {
    auto f = minimize(residuals, from.hypothesis, from.z, solver, &from);
    if (!f.fresh) refresh_jacobian(residuals, f);
    const Eigen::MatrixXd normal = f.normal();
    const double evidence = log_likelihood_ratio(f) - (log_determinant(normal) - determinant_without);
    if (evidence <= best.evidence) break;
    const auto weights = at_zero.slopes.cols();
    const double change = change_of_width(f.z.tail(weights), normal);
    width *= change;
    from = f;
    from.hypothesis = with_empirical(without.hypothesis, *at_zero.term, at_zero.fixed, width);
    from.z.tail(weights) /= change;
    from.jacobian.rightCols(weights) *= change;
    best.fit = std::move(f);
    best.evidence = evidence;
    if (std::abs(std::log(change)) < settled_width) break;
  }
  return best;
}

void trust_instruments(Hypothesis& h, Eigen::VectorXd& z) {
  std::vector<ScaledParameter> kept;
  std::vector<double> values;
  for (std::size_t i = 0; i < h.parameters.size(); ++i) {
    const auto& path = h.parameters[i].path;
    if (path.starts_with("gain.") || path.starts_with("offset.")) continue;
    kept.push_back(h.parameters[i]);
    values.push_back(z[static_cast<Eigen::Index>(i)]);
  }
  h.base_count -= h.parameters.size() - kept.size();
  h.parameters = std::move(kept);
  z = Eigen::Map<const Eigen::VectorXd>(values.data(), std::ssize(values));
}

}  // namespace ferrobench::model::inference
