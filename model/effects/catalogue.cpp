#include "model/effects/catalogue.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

namespace ferrobench::model {
namespace effects {
std::vector<Effect> all();  // generated: calls effect_<id>() of every file in this folder
}

std::string_view family_name(Family family) {
  constexpr std::array<std::string_view, 8> names{
      "kinetics", "strain",        "polarization",        "equilibrium",
      "drive",    "charge sensor", "displacement sensor", "force sensor"};
  return names.at(static_cast<std::size_t>(family));
}

bool is_sensor(Family family) {
  return family == Family::charge_sensor || family == Family::displacement_sensor ||
         family == Family::force_sensor;
}

std::span<const Effect> effect_catalogue() {
  static const std::vector<Effect> catalogue = effects::all();
  return catalogue;
}

namespace {

const Effect* look_up(std::string_view id) {
  for (const auto& effect : effect_catalogue())
    if (effect.id == id) return &effect;
  return nullptr;
}

Problem unknown_effect(std::string_view id, const std::string& path) {
  std::vector<std::string> ids;
  for (const auto& effect : effect_catalogue()) ids.emplace_back(effect.id);
  const auto guess = nearest_name(id, ids);
  return {.path = path,
          .message = "is not an effect of the catalogue",
          .given = id,
          .allowed = ids,
          .hint = guess.empty() ? "" : "did you mean \"" + guess + "\"?"};
}

void check_parameters(const Effect& effect, const EffectSetting& setting, const std::string& path,
                      std::vector<Problem>& problems) {
  std::vector<std::string> names;
  for (const auto& p : effect.parameters) names.emplace_back(p.name);
  const auto folder = path + "/parameters/";
  for (const auto& [name, value] : setting.parameters) {
    if (std::find(names.begin(), names.end(), name) == names.end())
      problems.push_back(
          {.path = folder + name, .message = "is not a parameter of " + setting.id, .allowed = names});
    else if (!std::isfinite(value))
      problems.push_back({.path = folder + name, .message = "must be finite"});
  }
  for (const auto& p : effect.parameters) {
    const auto found = std::find_if(setting.parameters.begin(), setting.parameters.end(),
                                    [&](const auto& given) { return given.first == p.name; });
    if (found == setting.parameters.end()) {
      problems.push_back(
          {.path = folder + std::string(p.name), .message = "is missing", .unit = std::string(p.unit)});
    } else if (p.above_zero ? found->second <= 0 : !p.any_sign && found->second < 0) {
      problems.push_back({.path = folder + std::string(p.name),
                          .message = p.above_zero ? "must be above zero" : "must not be negative",
                          .given = found->second,
                          .unit = std::string(p.unit)});
    }
  }
}

}  // namespace

const Effect& find_effect(std::string_view id) {
  if (const auto* effect = look_up(id)) return *effect;
  throw Error(ErrorCode::bad_model, "there is no such effect", unknown_effect(id, ""));
}

std::vector<Problem> check_effects(const std::vector<EffectSetting>& settings, const std::string& path) {
  std::vector<Problem> problems;
  std::set<std::string> seen;
  for (std::size_t i = 0; i < settings.size(); ++i) {
    const auto here = path + "/" + std::to_string(i);
    const auto* effect = look_up(settings[i].id);
    if (!seen.insert(settings[i].id).second)
      problems.push_back({.path = here + "/id", .message = "stands here twice", .given = settings[i].id});
    if (effect == nullptr)
      problems.push_back(unknown_effect(settings[i].id, here + "/id"));
    else
      check_parameters(*effect, settings[i], here, problems);
  }
  return problems;
}

template <class T>
void install_effects(ModelOf<T>& model, PortsOf<T>& ports) {
  auto settings = model.effects;
  std::sort(settings.begin(), settings.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
  for (const auto& setting : settings) {
    const auto& effect = find_effect(setting.id);
    std::vector<T> values;
    for (const auto& parameter : effect.parameters)
      for (const auto& [name, value] : setting.parameters)
        if (name == parameter.name) values.push_back(value);
    if (values.size() != effect.parameters.size())
      throw Error(ErrorCode::bad_model, "the effect's parameters are incomplete",
                  Problem{.path = "/effects", .message = "do not hold all parameters of " + setting.id});
    effect.install(Values<T>(values), model, ports);
  }
  std::stable_sort(ports.displacement.begin(), ports.displacement.end(),
                   [](const auto& a, const auto& b) { return a.order < b.order; });
}
template void install_effects(Model& model, Ports& ports);
template void install_effects(ModelOf<DualNumber>& model, PortsOf<DualNumber>& ports);

}  // namespace ferrobench::model
