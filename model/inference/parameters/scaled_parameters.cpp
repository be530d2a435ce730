#include "model/inference/parameters/scaled_parameters.h"

#include <algorithm>
#include <cmath>

#include "model/inference/parameters/parameters.h"

namespace ferrobench::model::inference {
namespace {

constexpr double known_to = 0.12, known_to_if_wrong = 0.5, factor_known_to = 0.05, gain_known_to = 0.03,
                 offset_known_to = 0.03;
// Ends of the ranges, in prior standard deviations. The model may be that of another specimen. A gain that is
// off by more than a sixth (5 times 3 %, in the logarithm), or a spring by more than a quarter (5 times 5 %),
// is a fault of the bench: where the model's physics is wrong, a fit would go there to make up for it, and
// what is missing would stay hidden.
constexpr double farthest = 12, farthest_of_instrument = 5;

ScaledParameter with_prior(std::string path, double from, double scale) {
  ScaledParameter out{.path = std::move(path), .from = from, .scale = scale, .low = 0, .high = 0};
  out.high = out.of_model() ? farthest : farthest_of_instrument;
  out.low = -out.high;
  return out;
}

}  // namespace

double ScaledParameter::value(double z) const {
  return logarithmic ? from * std::exp(scale * z) : from + scale * z;
}

double ScaledParameter::slope(double z) const {
  return logarithmic ? scale * value(z) : scale;
}

bool is_of_model(std::string_view path) {
  return !path.starts_with("gain.") && !path.starts_with("factor.") && !path.starts_with("offset.");
}

bool ScaledParameter::of_model() const {
  return is_of_model(path);
}

Eigen::VectorXd prior_mean(const Hypothesis& h) {
  return Eigen::VectorXd::Zero(static_cast<Eigen::Index>(h.parameters.size()));
}

Eigen::VectorXd carried_over(const Hypothesis& to, const Hypothesis& from, const Eigen::VectorXd& z) {
  auto out = prior_mean(to);
  for (std::size_t i = 0; i < to.parameters.size(); ++i) {
    const auto found = std::ranges::find(from.parameters, to.parameters[i].path, &ScaledParameter::path);
    if (found != from.parameters.end())
      out[static_cast<Eigen::Index>(i)] = z[found - from.parameters.begin()];
  }
  return out;
}

Setting setting_at(const Hypothesis& h, const Eigen::VectorXd& z) {
  Setting out;
  std::vector<std::pair<std::string, double>> values;
  for (std::size_t i = 0; i < h.parameters.size(); ++i) {
    const auto& c = h.parameters[i];
    const double value = c.value(z[static_cast<Eigen::Index>(i)]);
    if (c.of_model())
      values.emplace_back(c.path, value);
    else if (c.path == "factor.spring_stiffness")
      out.spring_factor = value;
    else if (c.path == "factor.prestress")
      out.prestress_factor = value;
    else if (c.path == "offset.field")
      out.field_offset = value;
    else
      for (std::size_t k = 0; k < compared_channels.size(); ++k)
        if (c.path.substr(5) == recordings::channel_name(compared_channels.at(k))) out.gain.at(k) = value;
  }
  out.model = with_parameters(h.model, values);
  return out;
}

std::optional<Setting> possible_setting(const Hypothesis& h, const Eigen::VectorXd& z) {
  try {
    return setting_at(h, z);
  } catch (const Error&) {
    return std::nullopt;
  }
}

BenchRecording apply_setting(const Setting& setting, const BenchRecording& recording) {
  auto out = recording;
  out.header.load.spring_stiffness *= setting.spring_factor;
  out.header.load.prestress *= setting.prestress_factor;
  static_assert(compared_channels[0] == recordings::Channel::field);
  if (!out.has_command)
    for (double& e : out.knot_field) e = (e - setting.field_offset) / setting.gain[0];
  return out;
}

Hypothesis base_hypothesis(const Model& model, const std::vector<BenchRecording>& bench) {
  Hypothesis out{.model = model, .parameters = {}, .base_count = 0};
  for (const auto& path : parameter_paths(model)) {
    const bool wanted = path.starts_with("material.") || path.starts_with("polycrystal.") ||
                        path.starts_with("effects.") || path == "actuator.passive_stiffness";
    if (!wanted || is_held(model, path)) continue;
    const double value = get_parameter(model, path);
    // What is zero is absent; to switch it on is an effect.
    if (value == 0) continue;
    out.parameters.push_back(with_prior(path, value, known_to));
  }
  const auto any = [&](auto&& test) { return std::ranges::any_of(bench, test); };
  if (any([](const BenchRecording& r) { return r.header.load.spring_stiffness > 0; }))
    out.parameters.push_back(with_prior("factor.spring_stiffness", 1, factor_known_to));
  if (any([](const BenchRecording& r) { return r.header.load.prestress > 0; }))
    out.parameters.push_back(with_prior("factor.prestress", 1, factor_known_to));
  const auto driven_by_field = [](const BenchRecording& r) { return !r.has_command; };
  for (const auto channel : compared_channels)
    if (any([channel](const BenchRecording& r) { return r.find(channel) != nullptr; }) ||
        (channel == recordings::Channel::field && any(driven_by_field)))
      out.parameters.push_back(
          with_prior("gain." + std::string(recordings::channel_name(channel)), 1, gain_known_to));
  if (any(driven_by_field)) {
    double low = 0, high = 0;
    for (const auto& r : bench)
      for (const double e : r.knot_field) {
        low = std::min(low, e);
        high = std::max(high, e);
      }
    out.parameters.push_back({.path = "offset.field",
                              .from = 0,
                              .scale = offset_known_to * (high - low),
                              .logarithmic = false,
                              .low = -farthest_of_instrument,
                              .high = farthest_of_instrument});
  }
  out.base_count = out.parameters.size();
  return out;
}

void widen_priors(Hypothesis& h, Eigen::VectorXd& z) {
  constexpr double wider = known_to_if_wrong / known_to;
  for (std::size_t i = 0; i < h.base_count; ++i) {
    auto& p = h.parameters[i];
    if (!p.of_model()) continue;
    p.scale *= wider;
    p.low /= wider;
    p.high /= wider;
    z[static_cast<Eigen::Index>(i)] /= wider;
  }
}

Hypothesis with_effect(const Hypothesis& h, const Effect& effect, const std::vector<double>& values) {
  auto out = h;
  EffectSetting setting{.id = std::string(effect.id), .parameters = {}};
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto& p = effect.parameters[i];
    setting.parameters.emplace_back(p.name, values[i]);
    ScaledParameter c;
    c.path = effect_path(effect.id, p.name);
    c.from = values[i];
    c.prior = false;
    const bool linear = p.any_sign && i == 0;
    c.logarithmic = !linear;
    // A frequency is known far better than any other shape.
    c.scale = linear ? 0.3 * std::abs(values[i]) : p.name == "frequency" ? 1e-4 : i == 0 ? 0.3 : 0.5;
    if (linear) {
      const double farthest_value = std::min(10.0, h.reach) * p.high;
      c.low = (-farthest_value - values[i]) / c.scale;
      c.high = (farthest_value - values[i]) / c.scale;
    } else {
      const double reach = p.name == "frequency" ? 1 : i == 0 ? h.reach : std::min(3.0, h.reach);
      c.low = std::log(p.low / reach / std::abs(values[i])) / c.scale;
      c.high = std::log(p.high * reach / std::abs(values[i])) / c.scale;
    }
    c.low = std::min(c.low, -1.0);
    c.high = std::max(c.high, 1.0);
    out.parameters.push_back(c);
  }
  out.model.effects.push_back(std::move(setting));
  return out;
}

Hypothesis without_effect(Hypothesis h, const std::string& id) {
  std::erase_if(h.model.effects, [&](const EffectSetting& e) { return e.id == id; });
  const auto its = [&](const ScaledParameter& p) { return is_of_effect(p.path, id); };
  const auto base = h.parameters.begin() + static_cast<std::ptrdiff_t>(h.base_count);
  h.base_count -= static_cast<std::size_t>(std::count_if(h.parameters.begin(), base, its));
  std::erase_if(h.parameters, its);
  return h;
}

Amplitude::Amplitude(const EffectParameter& p) : off_at_infinity(p.off_at_infinity), any_sign(p.any_sign) {
  weak = strength(p.off_at_infinity ? p.high : p.low);
  strong = strength(p.off_at_infinity ? p.low : p.high);
}

}  // namespace ferrobench::model::inference
