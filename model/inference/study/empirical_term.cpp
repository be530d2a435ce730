#include "model/inference/study/empirical_term.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace ferrobench::model::inference {
namespace {

constexpr double share_of_field = 0.05;
constexpr double farthest_weight = 12;  // in prior standard deviations
constexpr int width_rounds = 3;         // of the fixed point: it moves little after two
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
  for (const auto& r : bench)
    for (const double e : r.knot_field) out = std::max(out, std::abs(e));
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
    out.parameters.push_back({.path = "effects." + setting.id + "." + std::string(p.name),
                              .from = 0,
                              .scale = width,
                              .logarithmic = false,
                              .low = -farthest_weight,
                              .high = farthest_weight});
  }
  out.model.effects.push_back(std::move(setting));
  return out;
}

TriedTerm fit_empirical(const WhitenedRecordings& residuals, const Fit& without, const Effect& term,
                        std::vector<double> fixed,
                        const std::function<double(const Fit&)>& log_likelihood_ratio,
                        const SolverOptions& solver) {
  TriedTerm best{.term = &term, .fit = {}};
  const auto log_determinant = [](const Fit& f) {
    const Eigen::LDLT<Eigen::MatrixXd> factor(f.normal());
    return factor.vectorD().array().max(1e-300).log().sum();
  };
  const double determinant_without = log_determinant(without);
  const auto solve = [&](double width, const Eigen::VectorXd& from) {
    const auto hypothesis = with_empirical(without.hypothesis, term, fixed, width);
    Eigen::VectorXd z = prior_mean(hypothesis);
    z.head(from.size()) = from;
    auto f = minimize(residuals, hypothesis, z, solver, &without);
    if (!f.fresh) refresh_jacobian(residuals, f);
    return f;
  };
  const auto keep = [&](Fit f) {
    const double evidence = log_likelihood_ratio(f) - (log_determinant(f) - determinant_without);
    if (evidence <= best.evidence) return false;
    best.fit = std::move(f);
    best.evidence = evidence;
    return true;
  };
  if (term.parameters[fixed.size()].unit == "s") {
    const auto [shortest, longest] = residuals.times();
    fixed.push_back(0);
    double kept = 0;
    for (const double place : decades) {
      fixed.back() = 10 * shortest * std::pow(longest / (10 * shortest), place);
      if (keep(solve(1, without.z))) kept = fixed.back();
    }
    fixed.back() = kept;
  } else {
    keep(solve(1, without.z));
  }
  if (!std::isfinite(best.evidence)) return best;
  const auto known = without.z.size();
  double width = 1;
  for (int i = 0; i < width_rounds; ++i) {
    const auto weights = best.fit.z.tail(best.fit.z.size() - known);
    const Eigen::MatrixXd covariance = best.fit.normal().inverse();
    const double undetermined = covariance.diagonal().tail(weights.size()).sum(),
                 determined = static_cast<double>(weights.size()) - undetermined;
    width *= std::clamp(std::sqrt(weights.squaredNorm() / std::max(0.1, determined)), 0.1, 10.0);
    if (!keep(solve(width, best.fit.z.head(known)))) break;
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
