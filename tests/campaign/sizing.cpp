#include "tests/campaign/sizing.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

namespace ferrobench::campaign {

std::array<const std::vector<double>*, 4> columns(const Response& r) {
  return {&r.field, &r.charge, &r.displacement, &r.force};
}

model::Model loaded(const model::Model& base, const FieldProgram& program) {
  auto out = base;
  out.load.prestress *= program.prestress;
  out.load.spring_stiffness *= program.spring;
  return out;
}

Sizing::Sizing(const model::Model& base, const std::vector<FieldProgram>& programs,
               std::vector<std::size_t> channels)
    : base_(base), programs_(programs), channels_(std::move(channels)) {
  // Corners may be lost between the samples that are left, which is the same with and without the effect.
  for (auto& p : programs_) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < p.time.size(); i += thinning, ++kept) {
      p.time[kept] = p.time[i];
      p.command[kept] = p.command[i];
    }
    p.time.resize(kept);
    p.command.resize(kept);
  }
  without_ = play_all({});
}

std::vector<Response> Sizing::play_all(const model::Model& base, const std::vector<FieldProgram>& programs,
                                       const std::vector<model::EffectSetting>& effects) const {
  std::vector<Response> out;
  double session = 0;
  for (const auto& p : programs) {
    out.push_back(play(loaded(base, p), effects, p.time, p.command,
                       {.domains = 480, .path = 2, .session_time = session, .past = p.past}));
    session += p.time.back();
  }
  return out;
}

std::array<double, 4> Sizing::ranges() const {
  std::array<double, 4> out{};
  for (std::size_t c = 0; c < 4; ++c) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const auto& r : without_)
      for (const double v : *columns(r).at(c)) low = std::min(low, v), high = std::max(high, v);
    out.at(c) = high - low;
  }
  return out;
}

double Sizing::size(const model::EffectSetting& effect, const std::array<double, 4>& noise) const {
  std::vector<Response> with;
  try {
    with = play_all({effect});
  } catch (const Error&) {
    return std::numeric_limits<double>::infinity();
  }
  double largest = 0;
  for (std::size_t r = 0; r < with.size(); ++r)
    for (const std::size_t c : channels_) {
      const auto &a = *columns(with[r]).at(c), &b = *columns(without_[r]).at(c);
      double sum = 0;
      for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
      largest = std::max(largest, std::sqrt(sum / static_cast<double>(a.size())) / noise.at(c));
    }
  return std::isfinite(largest) ? largest : std::numeric_limits<double>::infinity();
}

// Secants in log(size) over log(parameter), within a bracket.
Sized sized(model::EffectSetting effect, const model::EffectParameter& first, double wanted,
            const std::function<double(const model::EffectSetting&)>& size, int tries) {
  double& value = effect.parameters.front().second;
  const double sign = value < 0 ? -1 : 1;
  const auto measure = [&](double log_value) {
    value = sign * std::exp(log_value);
    return std::log(std::max(1e-6, size(effect)) / wanted);
  };
  double low = std::log(first.low), high = std::log(first.high);
  double at = 0.5 * (low + high);
  // A limit, a resistivity, a stiffness, a decay time: the larger, the less.
  static const std::set<std::string, std::less<>> fading{"displacement_clipping", "amplifier_slew_limit",
                                                         "dielectric_leakage", "passive_layer_compliance",
                                                         "charge_amplifier_decay"};
  const bool rises = !fading.contains(effect.id);
  double last = 0, last_f = 0, f = 0;
  for (int i = 0; i < tries; ++i) {
    f = measure(at);
    if (std::abs(f) < 0.15) break;
    ((f > 0) == rises ? high : low) = at;
    double next = at - f * (rises ? 1 : -1);
    if (i > 0 && std::isfinite(f) && std::isfinite(last_f) && f != last_f)
      next = at - f * (at - last) / (f - last_f);
    last = at;
    last_f = f;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    at = next;
  }
  return {effect, wanted * std::exp(f)};
}

}  // namespace ferrobench::campaign
