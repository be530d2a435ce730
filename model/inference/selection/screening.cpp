#include "model/inference/selection/screening.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "model/inference/solver/projection.h"

namespace ferrobench::model::inference {
namespace {

// A smaller change of the sum of squares than this is the solver's noise, so the amplitude is raised.
constexpr double least_response = 1e-2;
// A later screen starts at the amplitude whose response came nearest to five standard deviations.
constexpr double plausible_response = 25;

std::vector<double> shapes_of(const EffectParameter& p, const WhitenedResiduals& residuals, const Fit& fit) {
  if (p.name == "frequency") return residuals.tones(fit.residual, p, 4);
  double low = p.low, high = p.high;
  int count = 3;
  if (p.unit == "s") {
    // Times shorter than the sampling interval or much longer than the recordings do not show in these data.
    const auto [shortest, longest] = residuals.times();
    low = std::clamp(3 * shortest, p.low, p.high);
    high = std::clamp(2 * longest, low, p.high);
    count = 4;
  }
  std::vector<double> out;
  out.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) out.push_back(low * std::pow(high / low, (i + 0.5) / count));
  return out;
}

struct Probe {
  std::size_t effect = 0;      // index in the list
  std::vector<double> shapes;  // of the parameters after the first
  double strength = 0;
  int sign = 1;
  bool done = false;
  // An effect with a threshold sets in between these strengths.
  double too_weak = 0, too_strong = std::numeric_limits<double>::infinity();
};

}  // namespace

std::vector<Eigen::VectorXd> responses(const WhitenedResiduals& residuals, const Fit& fit,
                                       std::span<const EffectStart> effects) {
  std::vector<Hypothesis> hypotheses;
  hypotheses.reserve(effects.size());
  std::vector<std::pair<const Hypothesis*, Eigen::VectorXd>> places;
  for (const auto& e : effects) {
    hypotheses.push_back(with_effect(fit.hypothesis, *e.effect, e.values));
    auto z = prior_mean(hypotheses.back());
    z.head(fit.z.size()) = fit.z;
    places.emplace_back(&hypotheses.back(), std::move(z));
  }
  auto out = residuals.evaluate(places);
  for (auto& r : out) r = fit.corrected(r) - fit.residual;
  return out;
}

std::vector<Screened> screen(const WhitenedResiduals& residuals, const Fit& fit,
                             const ScreenOptions& options) {
  const Projection projection(fit);
  std::vector<Screened> out(options.effects.size());
  std::vector<Probe> probes;
  for (std::size_t e = 0; e < options.effects.size(); ++e) {
    const auto& effect = *options.effects[e];
    out[e].effect = &effect;
    const Amplitude amplitude(effect.parameters.front());
    std::vector<std::vector<double>> grid{{}};
    for (std::size_t k = 1; k < effect.parameters.size(); ++k) {
      const auto shapes = shapes_of(effect.parameters[k], residuals, fit);
      std::vector<std::vector<double>> next;
      for (const auto& g : grid)
        for (const double s : shapes) {
          next.push_back(g);
          next.back().push_back(s);
        }
      grid = std::move(next);
    }
    double start = std::sqrt(amplitude.weak * amplitude.strong);
    for (const auto& before : options.before)
      if (before.effect == &effect && before.across > 0) start = before.strength;
    const auto limits = residuals.limits(effect.parameters.front());
    for (auto& shapes : grid) {
      for (const double limit : limits)
        probes.push_back({.effect = e, .shapes = shapes, .strength = amplitude.strength(limit)});
      probes.push_back({.effect = e, .shapes = std::move(shapes), .strength = start});
    }
  }
  const auto values_of = [&](const Probe& p) {
    const Amplitude amplitude(out[p.effect].effect->parameters.front());
    std::vector<double> values{p.sign * amplitude.value(p.strength)};
    values.insert(values.end(), p.shapes.begin(), p.shapes.end());
    return values;
  };

  for (int round = 0; round < options.rounds; ++round) {
    std::vector<Probe*> open;
    for (auto& p : probes)
      if (!p.done) open.push_back(&p);
    // Those that differ in sensors only together: one simulation shows them all.
    std::stable_partition(open.begin(), open.end(),
                          [&](const Probe* p) { return is_sensor(out[p->effect].effect->family); });
    for (std::size_t begin = 0; begin < open.size(); begin += responses_at_a_time) {
      const std::size_t end = std::min(open.size(), begin + responses_at_a_time);
      std::vector<EffectStart> asked;
      for (std::size_t i = begin; i < end; ++i)
        asked.push_back({out[open[i]->effect].effect, values_of(*open[i])});
      const auto there = responses(residuals, fit, asked);
      for (std::size_t i = begin; i < end; ++i) {
        auto& p = *open[i];
        auto& s = out[p.effect];
        const Amplitude amplitude(s.effect->parameters.front());
        const double low = amplitude.weak / 30, high = amplitude.strong * 30;
        const auto go_to = [&](double strength) {
          double next = std::clamp(strength, low, high);
          if (p.too_weak > 0 && p.too_strong < high && (next <= p.too_weak || next >= p.too_strong))
            next = std::sqrt(p.too_weak * p.too_strong);
          p.done = std::abs(std::log(next / p.strength)) < 0.1;
          p.strength = next;
        };
        const Eigen::VectorXd& r = there[i - begin];
        if (WhitenedResiduals::is_unsolved(r)) {
          go_to(0.1 * p.strength);
          continue;
        }
        const Drop d = projection.drop(r);
        if (p.strength <= amplitude.strong * 1.0001)
          s.excited =
              std::max(s.excited, d.across * std::pow(std::min(30.0, amplitude.strong / p.strength), 2));
        if (d.across < least_response) {
          p.too_weak = std::max(p.too_weak, p.strength);
          go_to(20 * p.strength);
          continue;
        }
        const double drop = d.at(1);
        if (drop > s.drop || s.values.empty()) {
          s.drop = drop;
          s.values = values_of(p);
          s.response = r;
        }
        if (s.across == 0 || std::abs(std::log(d.across / plausible_response)) <
                                 std::abs(std::log(s.across / plausible_response))) {
          s.across = d.across;
          s.strength = p.strength;
        }
        double scale = d.along / d.across;
        const bool turned = scale < 0 && amplitude.any_sign;
        if (scale < 0) {
          if (amplitude.any_sign) {
            p.sign = -p.sign;
            scale = -scale;
          } else {
            // Effects with a threshold may help only where they are weak.
            p.too_strong = std::min(p.too_strong, p.strength);
            go_to(0.2 * p.strength);
            continue;
          }
        }
        if (scale < 0.7) p.too_strong = std::min(p.too_strong, p.strength);
        go_to(p.strength * std::clamp(scale, 0.05, 20.0));
        p.done = p.done && !turned;
      }
      if (options.tick)
        options.tick((round + static_cast<double>(end) / static_cast<double>(open.size())) / options.rounds);
    }
  }
  std::ranges::stable_sort(out, std::greater<>(), &Screened::drop);
  return out;
}

}  // namespace ferrobench::model::inference
