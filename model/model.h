// The model file (version 1): material, polycrystal, actuator, load and effects. SI units throughout.
// Equation numbers are those of the source. Signs: field along the poling direction; stress tension-positive;
// prestress compressive-positive; strain and displacement positive in extension.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/fields.h"

namespace ferrobench::model {

// The number of type T: double, or one that carries tangents (physics/dual.h). A count of layers is whole
// unless it carries some.
template <class T>
using Count = std::conditional_t<std::is_same_v<T, double>, std::int64_t, T>;

enum class BarrierLaw { equal_curvature, unequal_curvature };
enum class PolycrystalMethod { none, distribution, parametrized };

std::span<const std::pair<BarrierLaw, std::string_view>> enum_names(BarrierLaw);
std::span<const std::pair<PolycrystalMethod, std::string_view>> enum_names(PolycrystalMethod);

template <class T>
struct MaterialOf {
  T remanent_polarization = 0.3;  // C/m^2, P_+ = -P_-
  T remanent_strain_90 = -0.003;  // eps_90, relative to the +180 state
  T permittivity_180 = 2.5e-8;    // F/m
  T permittivity_90 = 2.5e-8;     // F/m
  T compliance_180 = 1.8e-11;     // 1/Pa
  T compliance_90 = 1.8e-11;      // 1/Pa
  T piezoelectric_180 = 5.5e-10;  // m/V, d_+ = -d_-
  T barrier = 5e4;                // J/m^3, dg0 (4.25)
  T relaxation_time = 1e-2;       // s, tau (4.23)
  T activation_volume = 2.2e-24;  // m^3, V (4.23)
  T temperature = 295;            // K
  BarrierLaw barrier_law = BarrierLaw::equal_curvature;
};
using Material = MaterialOf<double>;

// A point of the critical driving force of the parametrized polycrystal (4.63).
struct CriticalForcePoint {
  double fraction = 0;  // x+
  double force = 0;     // J/m^3
};

// F_cr(x+), both branches by rising fraction, as calibrated at `prestress`; another prestress adds
// prestress_shift * (prestress - calibration) to both branches (the linear mapping of section 4.3.2). Load
// must lie below unload at every fraction: where it did not, neither way would have a barrier.
struct CriticalForce {
  std::vector<CriticalForcePoint> unload;  // +180 -> 90
  std::vector<CriticalForcePoint> load;    // 90 -> +180
  double prestress = 0;                    // Pa
  double prestress_shift = 0;              // J/m^3 per Pa
};

// A branch of it at any fraction: straight between its points, level beyond them.
double force_at(std::span<const CriticalForcePoint> branch, double fraction);

template <class T>
struct PolycrystalOf {
  PolycrystalMethod method = PolycrystalMethod::none;
  T barrier_log_std = 0;                        // 1
  T interaction_field_std = 0;                  // V/m
  T interaction_stress_std = 0;                 // Pa
  T bias_field = 0;                             // V/m
  std::optional<CriticalForce> critical_force;  // "parametrized" only
};
using Polycrystal = PolycrystalOf<double>;

template <class T>
struct ActuatorOf {
  T length = 0.01;           // m, active
  T area = 2.5e-5;           // m^2
  T layer_thickness = 1e-4;  // m
  Count<T> layer_count = 100;
  std::optional<T> passive_stiffness;  // N/m; absent: rigid
};
using Actuator = ActuatorOf<double>;

template <class T>
struct LoadOf {
  T spring_stiffness = 0;  // N/m
  T prestress = 0;         // Pa
};
using Load = LoadOf<double>;

// One effect of the catalogue, switched on. Parameters in the order of the effect's own list.
template <class T>
struct EffectSettingOf {
  std::string id;
  std::vector<std::pair<std::string, T>> parameters;
};
using EffectSetting = EffectSettingOf<double>;

template <class T>
struct ModelOf {
  std::string name;
  std::string notes;
  MaterialOf<T> material;
  PolycrystalOf<T> polycrystal;
  ActuatorOf<T> actuator;
  LoadOf<T> load;
  std::vector<EffectSettingOf<T>> effects;
};
using Model = ModelOf<double>;

// Throw Error(bad_model) with every problem and its JSON pointer.
Model model_from_json(const nlohmann::json& json);
Model model_from_text(std::string_view text);
Model model_from_file(const std::string& path);
nlohmann::json to_json(const Model& model);
nlohmann::json model_schema();

// The shipped parameter sets (model/library/), by name.
std::vector<std::string> model_library_names();
Model library_model(std::string_view name);  // Error(not_found) with the nearest name

}  // namespace ferrobench::model
