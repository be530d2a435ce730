#include "model/inference/study/empirical_term.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace ferrobench::model::inference {
namespace {

constexpr double share_of_field = 0.05;
constexpr double farthest_weight = 12;  // in prior standard deviations

double largest_error(recordings::Channel channel, const std::vector<BenchRecording>& bench,
                     const std::vector<std::size_t>& chosen,
                     const std::vector<std::vector<NoiseModel>>& noise) {
  double out = 0;
  for (const std::size_t r : chosen)
    for (std::size_t c = 0; c < noise[r].size(); ++c)
      if (bench[r].channels[c].channel == channel) out = std::max(out, noise[r][c].model_error);
  return out;
}

}  // namespace

std::vector<const Effect*> empirical_terms() {
  std::vector<const Effect*> out;
  for (const auto& e : effect_catalogue())
    if (e.empirical) out.push_back(&e);
  return out;
}

double largest_field(const std::vector<BenchRecording>& bench) {
  double out = 0;
  for (const auto& r : bench)
    for (const double e : r.knot_field) out = std::max(out, std::abs(e));
  return out;
}

double term_amplitude(const Effect& term, const Model& model, const std::vector<BenchRecording>& bench,
                      const std::vector<std::size_t>& chosen,
                      const std::vector<std::vector<NoiseModel>>& noise) {
  using recordings::Channel;
  const auto& a = model.actuator;
  switch (term.family) {
    case Family::strain:
      return largest_error(Channel::displacement, bench, chosen, noise) / a.length;
    case Family::polarization:
      return largest_error(Channel::charge, bench, chosen, noise) /
             (a.area * static_cast<double>(a.layer_count));
    default:
      return share_of_field * largest_field(bench);
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
