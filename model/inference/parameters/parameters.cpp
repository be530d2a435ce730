#include "model/inference/parameters/parameters.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "model/effects/catalogue.h"
#include "model/model_fields.h"

namespace ferrobench::model {
namespace {

std::string pointer_of(std::string_view path) {
  std::string out = "/";
  for (const char c : path) out += c == '.' ? '/' : c;
  return out;
}

[[noreturn]] void unknown(const Model& model, std::string_view path) {
  const auto allowed = parameter_paths(model);
  const auto guess = nearest_name(path, allowed);
  throw Error(ErrorCode::invalid_params, "the model has no such number",
              Problem{.path = pointer_of(path),
                      .message = "is not a number of this model",
                      .given = path,
                      .allowed = allowed,
                      .hint = guess.empty() ? "" : "did you mean \"" + guess + "\"?"});
}

// Effects are a list in the file; by path they go by their id.
nlohmann::json* find(nlohmann::json& json, std::string_view path) {
  nlohmann::json* at = &json;
  while (!path.empty()) {
    const auto dot = path.find('.');
    const auto key = std::string(path.substr(0, dot));
    path = dot == std::string_view::npos ? std::string_view{} : path.substr(dot + 1);
    if (at->is_array()) {
      nlohmann::json* next = nullptr;
      for (auto& item : *at)
        if (item.value("id", "") == key) next = &item["parameters"];
      if (next == nullptr) return nullptr;
      at = next;
    } else if (at->is_object() && at->contains(key)) {
      at = &(*at)[key];
    } else {
      return nullptr;
    }
  }
  return at->is_number() || at->is_null() ? at : nullptr;
}

void collect(const nlohmann::json& json, const std::string& path, std::vector<std::string>& out) {
  const auto under = [&](const std::string& key) { return path.empty() ? key : path + "." + key; };
  if (json.is_number()) {
    out.push_back(path);
  } else if (json.is_object()) {
    for (const auto& [key, value] : json.items())
      if (key != "version" && key != "critical_force") collect(value, under(key), out);
  } else if (json.is_array()) {
    for (const auto& item : json)
      if (item.contains("id")) collect(item["parameters"], under(item["id"].get<std::string>()), out);
  }
}

// Where a fit may move a number of the model outside of its effects.
struct NumberRange {
  std::string_view path;
  double low = 0, high = 0;
  bool logarithmic = true;
};
// J/m^3: with 1 C/m^2 the wells cross at 2,000 kV/mm, where every specimen has broken down. A fit may end at
// its range's end, and a recalibration go on from there: that is a specimen that switches.
constexpr double no_switching = 5e8;

// J/m^3, of bulk specimens.
constexpr double highest_barrier = 5e5;
constexpr std::array ranges{NumberRange{"material.remanent_polarization", 0.1, 0.6},
                            NumberRange{"material.remanent_strain_90", -0.02, -0.0005},
                            NumberRange{"material.permittivity_180", 1e-9, 1e-7},
                            NumberRange{"material.permittivity_90", 1e-9, 1e-7},
                            NumberRange{"material.compliance_180", 8e-12, 5e-11},
                            NumberRange{"material.compliance_90", 8e-12, 5e-11},
                            NumberRange{"material.piezoelectric_180", 1e-10, 1.2e-9},
                            NumberRange{"material.barrier", 2e3, highest_barrier},
                            NumberRange{"material.relaxation_time", 1e-12, 10},
                            NumberRange{"material.activation_volume", 1e-26, 1e-22},
                            NumberRange{"material.temperature", 253, 373, false},
                            NumberRange{"polycrystal.barrier_log_std", 0.01, 1.5},
                            NumberRange{"polycrystal.interaction_field_std", 1e3, 1.5e6},
                            NumberRange{"polycrystal.interaction_stress_std", 1e4, 2e8},
                            NumberRange{"polycrystal.bias_field", -5e5, 5e5, false},
                            NumberRange{"actuator.length", 1e-4, 1},
                            NumberRange{"actuator.area", 1e-8, 1e-2},
                            NumberRange{"actuator.layer_thickness", 1e-7, 1e-2},
                            NumberRange{"actuator.layer_count", 1, 1e5},
                            NumberRange{"actuator.passive_stiffness", 1e5, 1e10},
                            NumberRange{"load.spring_stiffness", 1e3, 1e9},
                            NumberRange{"load.prestress", 0, 1e8, false}};

// V/m: bulk specimens are not driven farther, nor are the stages that are made of them. The coercive field of
// films is ten times theirs and more (M. Dawber, K. M. Rabe and J. F. Scott, Rev. Mod. Phys. 77 (2005) 1083).
constexpr double bulk_field = 3e6;
// Beyond that a barrier would be one at which nothing switches.
constexpr double most_above_bulk = no_switching / highest_barrier;
// Films are of other ferroelectrics as well, and those of HfO2 and AlN have a tenth of PZT's permittivity: it
// may be as low as what makes this share of the polarization at the largest field.
constexpr double least_dielectric_share = 0.1;
// Not all domains switch, so that P_r is more than half of what the polarization covers.
constexpr double more_than_half_the_swing = 1.2;

// Of a number that grows with the coercive field.
bool is_field_or_energy(std::string_view unit) {
  return unit == "V/m" || unit == "V m/C" || unit == "J/m^3";
}

FreeParameter for_evidence(FreeParameter p, const Evidence& evidence) {
  if (p.path == "material.remanent_polarization")
    p.high = std::max(p.high, more_than_half_the_swing * evidence.largest_polarization);
  if (p.path.starts_with("material.permittivity_") && evidence.largest_polarization > 0)
    p.low = std::min(p.low, least_dielectric_share * evidence.largest_polarization / evidence.largest_field);
  const double times = std::min(evidence.largest_field / bulk_field, most_above_bulk);
  if (times > 1 && is_field_or_energy(parameter_unit(p.path))) {
    p.low *= times;
    p.high *= times;
  }
  return p;
}

}  // namespace

double get_parameter(const Model& model, std::string_view path) {
  auto copy = model;
  std::optional<double> found;
  for_each_number(copy, [&](const std::string& name, double& number) {
    if (name == path) found = number;
  });
  if (found) return *found;
  unknown(model, path);
}

Model with_parameters(const Model& model, const std::vector<std::pair<std::string, double>>& values) {
  auto json = to_json(model);
  for (const auto& [path, value] : values) {
    auto* found = find(json, path);
    if (found == nullptr) unknown(model, path);
    *found = value;
  }
  return model_from_json(json);
}

void set_parameter(Model& model, std::string_view path, double value) {
  bool found = false;
  for_each_number(model, [&](const std::string& name, double& number) {
    if (name != path) return;
    number = value;
    found = true;
  });
  if (!found) unknown(model, path);
}

std::vector<std::string> parameter_paths(const Model& model) {
  std::vector<std::string> out;
  collect(to_json(model), "", out);
  return out;
}

std::string effect_path(std::string_view id, std::string_view parameter) {
  return "effects." + std::string(id) + "." + std::string(parameter);
}

bool is_of_effect(std::string_view path, std::string_view id) {
  return path.starts_with(effect_path(id, ""));
}

std::string parameter_unit(std::string_view path) {
  const auto dot = path.rfind('.');
  const auto owner = path.substr(0, dot), name = path.substr(dot + 1);
  if (owner.starts_with("effects.")) {
    for (const auto& p : find_effect(owner.substr(8)).parameters)
      if (p.name == name) return std::string(p.unit);
    return "";
  }
  const auto schema = model_schema();
  const auto found = nlohmann::json::json_pointer("/properties/" + std::string(owner) + "/properties/" +
                                                  std::string(name) + "/x-unit");
  return schema.contains(found) ? schema.at(found).get<std::string>() : "";
}

FreeParameter free_parameter(const Model& model, std::string_view path, const Evidence& evidence) {
  if (const auto* r = std::ranges::find(ranges, path, &NumberRange::path); r != ranges.end())
    return for_evidence({std::string(path), r->low, r->high, r->logarithmic}, evidence);
  if (path.starts_with("effects.")) {
    const auto rest = path.substr(8);
    const auto dot = rest.find('.');
    const auto& effect = find_effect(rest.substr(0, dot));
    if (dot != std::string_view::npos)
      for (const auto& p : effect.parameters)
        if (p.name == rest.substr(dot + 1))
          return for_evidence(
              {std::string(path), p.any_sign ? -p.high : p.low, p.high, !p.any_sign && p.low > 0}, evidence);
  }
  unknown(model, path);
}

double to_unit(const FreeParameter& p, double value) {
  if (!p.logarithmic) return std::clamp((value - p.low) / (p.high - p.low), 0.0, 1.0);
  if (value / p.low <= 0) return p.low < 0 ? 1 : 0;
  return std::clamp(std::log(value / p.low) / std::log(p.high / p.low), 0.0, 1.0);
}

double from_unit(const FreeParameter& p, double u) {
  u = std::clamp(u, 0.0, 1.0);
  if (u == 1) return p.high;
  return p.logarithmic ? p.low * std::pow(p.high / p.low, u) : p.low + u * (p.high - p.low);
}

double unit_slope(const FreeParameter& p, double u) {
  return p.logarithmic ? from_unit(p, u) * std::log(p.high / p.low) : p.high - p.low;
}

bool switches(const Model& model) {
  return model.material.barrier <= no_switching;
}

bool is_held(const Model& model, std::string_view path) {
  if (path == "material.temperature") return true;
  constexpr std::string_view effects = "effects.";
  if (path.starts_with(effects)) {
    const auto id = path.substr(effects.size(), path.rfind('.') - effects.size());
    return find_effect(id).table;
  }
  constexpr std::array of_switching{"material.remanent_polarization",
                                    "material.remanent_strain_90",
                                    "material.permittivity_90",
                                    "material.compliance_90",
                                    "material.barrier",
                                    "material.relaxation_time",
                                    "material.activation_volume"};
  return !switches(model) &&
         (path.starts_with("polycrystal.") || std::ranges::find(of_switching, path) != of_switching.end());
}

std::vector<FreeParameter> default_free_parameters(const Model& model, const Evidence& evidence) {
  constexpr std::array of_elasticity{"material.remanent_strain_90", "material.compliance_180",
                                     "material.compliance_90", "material.piezoelectric_180"};
  std::vector<FreeParameter> out;
  for (const auto& path : parameter_paths(model)) {
    const bool wanted =
        path.starts_with("material.") || path.starts_with("polycrystal.") || path.starts_with("effects.");
    if (!wanted || is_held(model, path)) continue;
    if (!evidence.shows_elasticity && std::ranges::find(of_elasticity, path) != of_elasticity.end()) continue;
    if (path.starts_with("polycrystal.") && path != "polycrystal.bias_field" &&
        get_parameter(model, path) == 0)
      continue;
    out.push_back(free_parameter(model, path, evidence));
  }
  return out;
}

}  // namespace ferrobench::model
