#include "model/discrepancy/screen.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

namespace ferrobench::model::discrepancy {
namespace {

using recordings::Channel;

constexpr double least_response = 1e-2;  // sum of squares; less is none
constexpr double plausible_response = 25;

// Frequencies at which the displacement's residual has its strongest tones, phase zero at each start.
std::vector<double> tones(const Misfit& misfit, const Fit& fit, const EffectParameter& range,
                          std::size_t count) {
  // In the longest recording, which resolves them best; the screen weighs them in all.
  const Block* longest_block = nullptr;
  double longest = 0;
  for (const auto& b : misfit.blocks()) {
    const auto& r = misfit.bench()[b.recording];
    if (r.channels[b.channel].channel != Channel::displacement || b.count < 32) continue;
    if (r.duration() <= longest) continue;
    longest = r.duration();
    longest_block = &b;
  }
  if (longest_block == nullptr) return {};
  const Block& first = *longest_block;
  const auto& times = misfit.bench()[first.recording].time;
  const double step = 0.3 / longest;
  const auto bins = static_cast<std::size_t>(std::min(400000.0, (range.high - range.low) / step));
  std::vector<double> power(bins, 0.0);
  in_parallel(bins / 1000 + 1, misfit.threads(), [&](std::size_t chunk) {
    for (std::size_t b = chunk * 1000; b < std::min(bins, (chunk + 1) * 1000); ++b) {
      const double w = 2 * std::numbers::pi * (range.low + step * static_cast<double>(b));
      // Evenly sampled stretches need one rotation a sample.
      std::complex<double> wave = 1, turn = 1;
      double last_dt = -1, sum = 0, square = 0, last = times[first.rows[0]];
      wave = std::polar(1.0, w * last);
      for (std::size_t i = 0; i < first.rows.size(); ++i) {
        const double t = times[first.rows[i]], dt = t - last;
        if (dt > 0) {
          if (std::abs(dt - last_dt) > 1e-9 * dt) {
            turn = std::polar(1.0, w * dt);
            last_dt = dt;
          }
          wave *= turn;
          if (i % 64 == 0) wave = std::polar(1.0, w * t);
        }
        last = t;
        const double s = wave.imag();
        sum += s * fit.residual[first.begin + static_cast<Eigen::Index>(i)];
        square += s * s;
      }
      power[b] = square > 1 ? sum * sum / square : 0;
    }
  });
  std::vector<double> out;
  for (std::size_t k = 0; k < count; ++k) {
    const auto top = std::max_element(power.begin(), power.end());
    if (top == power.end() || *top <= 0) break;
    const auto at = top - power.begin();
    out.push_back(range.low + step * static_cast<double>(at));
    for (std::ptrdiff_t i = std::max<std::ptrdiff_t>(0, at - 4);
         i < std::min<std::ptrdiff_t>(at + 5, std::ssize(power)); ++i)
      power[static_cast<std::size_t>(i)] = 0;
  }
  return out;
}

std::vector<double> shapes_of(const EffectParameter& p, const Misfit& misfit, const Fit& fit) {
  if (p.name == "frequency") return tones(misfit, fit, p, 4);
  double low = p.low, high = p.high;
  int count = 3;
  if (p.unit == "s") {
    // Shorter than the samples or much longer than the recordings is none of these data's business.
    double shortest = p.high, longest = 0;
    for (const std::size_t r : misfit.chosen()) {
      const auto& b = misfit.bench()[r];
      longest = std::max(longest, b.duration());
      shortest = std::min(shortest, b.duration() / static_cast<double>(b.time.size()));
    }
    low = std::clamp(3 * shortest, p.low, p.high);
    high = std::clamp(2 * longest, low, p.high);
    count = 4;
  }
  std::vector<double> out;
  for (int i = 0; i < count; ++i) out.push_back(low * std::pow(high / low, (i + 0.5) / count));
  return out;
}

struct Probe {
  std::size_t effect = 0;      // index in the list
  std::vector<double> shapes;  // of the parameters after the first
  double strength = 0;
  int sign = 1;
  bool done = false;
};

}  // namespace

std::vector<Screened> screen(const Misfit& misfit, const Fit& fit, const ScreenOptions& options) {
  const Projection projection(fit);
  std::vector<Screened> out(options.effects.size());
  std::vector<Probe> probes;
  for (std::size_t e = 0; e < options.effects.size(); ++e) {
    const auto& effect = *options.effects[e];
    out[e].effect = &effect;
    const Amplitude amplitude(effect.parameters.front());
    std::vector<std::vector<double>> grid{{}};
    for (std::size_t k = 1; k < effect.parameters.size(); ++k) {
      const auto shapes = shapes_of(effect.parameters[k], misfit, fit);
      std::vector<std::vector<double>> next;
      for (const auto& g : grid)
        for (const double s : shapes) {
          next.push_back(g);
          next.back().push_back(s);
        }
      grid = std::move(next);
    }
    for (auto& shapes : grid)
      probes.push_back({.effect = e,
                        .shapes = std::move(shapes),
                        .strength = std::sqrt(amplitude.weak * amplitude.strong)});
  }
  const auto values_of = [&](const Probe& p) {
    const Amplitude amplitude(out[p.effect].effect->parameters.front());
    std::vector<double> values{p.sign * amplitude.value(p.strength)};
    values.insert(values.end(), p.shapes.begin(), p.shapes.end());
    return values;
  };

  constexpr std::size_t batch = 16;
  for (int round = 0; round < options.rounds; ++round) {
    std::vector<Probe*> open;
    for (auto& p : probes)
      if (!p.done) open.push_back(&p);
    for (std::size_t begin = 0; begin < open.size(); begin += batch) {
      const std::size_t end = std::min(open.size(), begin + batch);
      std::vector<Hypothesis> hypotheses;
      hypotheses.reserve(end - begin);
      std::vector<std::pair<const Hypothesis*, Eigen::VectorXd>> places;
      for (std::size_t i = begin; i < end; ++i) {
        hypotheses.push_back(with_effect(fit.hypothesis, *out[open[i]->effect].effect, values_of(*open[i])));
        Eigen::VectorXd z =
            Eigen::VectorXd::Zero(static_cast<Eigen::Index>(hypotheses.back().coordinates.size()));
        z.head(fit.z.size()) = fit.z;
        places.emplace_back(&hypotheses.back(), std::move(z));
      }
      const auto residuals = misfit.residuals(places);
      for (std::size_t i = begin; i < end; ++i) {
        auto& p = *open[i];
        auto& s = out[p.effect];
        const Amplitude amplitude(s.effect->parameters.front());
        const double low = amplitude.weak / 30, high = amplitude.strong * 30;
        const auto go_to = [&](double strength) {
          const double next = std::clamp(strength, low, high);
          p.done = std::abs(std::log(next / p.strength)) < 0.1;
          p.strength = next;
        };
        const Eigen::VectorXd r = residuals[i - begin] - fit.residual;
        if (r.cwiseAbs().maxCoeff() > 1e5) {
          go_to(0.1 * p.strength);
          continue;
        }
        const Drop d = projection.drop(r);
        if (p.strength <= amplitude.strong * 1.0001)
          s.excited =
              std::max(s.excited, d.across * std::pow(std::min(30.0, amplitude.strong / p.strength), 2));
        if (d.across < least_response) {
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
        if (scale < 0) {
          if (amplitude.any_sign) {
            p.sign = -p.sign;
            scale = -scale;
          } else {
            // Threshold effects may start to help only where they are weak.
            go_to(0.2 * p.strength);
            continue;
          }
        }
        go_to(p.strength * std::clamp(scale, 0.05, 20.0));
      }
      if (options.tick)
        options.tick((round + static_cast<double>(end) / static_cast<double>(open.size())) / options.rounds);
    }
  }
  std::ranges::stable_sort(out, std::greater<>(), &Screened::drop);
  return out;
}

}  // namespace ferrobench::model::discrepancy
