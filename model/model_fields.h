// The fields of the model file (base/fields.h), and every number of a model by its path.
#pragma once

#include <cmath>
#include <string>

#include "base/load_range.h"
#include "model/model.h"

namespace ferrobench::model {

template <class Visitor, class T>
void describe(Visitor& visit, MaterialOf<T>& m) {
  visit("remanent_polarization", m.remanent_polarization,
        {.unit = "C/m^2", .min = 1e-4, .max = 2, .required = true, .doc = "P_+ = -P_-"});
  visit("remanent_strain_90", m.remanent_strain_90,
        {.unit = "1", .min = -0.1, .max = -1e-7, .required = true, .doc = "eps_90 against the +180 state"});
  visit("permittivity_180", m.permittivity_180, {.unit = "F/m", .min = 0, .max = 1e-5, .required = true});
  visit("permittivity_90", m.permittivity_90, {.unit = "F/m", .min = 0, .max = 1e-5, .required = true});
  visit("compliance_180", m.compliance_180, {.unit = "1/Pa", .min = 0, .max = 1e-8, .required = true});
  visit("compliance_90", m.compliance_90, {.unit = "1/Pa", .min = 0, .max = 1e-8, .required = true});
  visit("piezoelectric_180", m.piezoelectric_180,
        {.unit = "m/V", .min = -1e-7, .max = 1e-7, .required = true});
  visit("barrier", m.barrier,
        {.unit = "J/m^3",
         .min = 1e-2,
         .max = 1e9,
         .required = true,
         .doc = "barrier energy at zero driving force"});
  visit("relaxation_time", m.relaxation_time, {.unit = "s", .min = 1e-15, .max = 1e6, .required = true});
  visit("activation_volume", m.activation_volume,
        {.unit = "m^3", .min = 1e-28, .max = 1e-15, .required = true});
  visit("temperature", m.temperature, {.unit = "K", .min = 1, .max = 2000, .required = true});
  visit("barrier_law", m.barrier_law, {.required = true});
}

template <class Visitor>
void describe(Visitor& visit, CriticalForcePoint& p) {
  visit("fraction", p.fraction, {.unit = "1", .min = 0, .max = 1, .required = true, .doc = "x+"});
  visit("force", p.force,
        {.unit = "J/m^3", .required = true, .doc = "driving force F_+90 at which switching goes on"});
}

template <class Visitor>
void describe(Visitor& visit, CriticalForce& c) {
  visit("unload", c.unload, {.required = true, .doc = "+180 -> 90, by rising fraction"});
  visit("load", c.load, {.required = true, .doc = "90 -> +180, by rising fraction"});
  visit("prestress", c.prestress,
        {.unit = "Pa", .required = true, .doc = "of the loop it was calibrated from"});
  visit("prestress_shift", c.prestress_shift,
        {.unit = "J/m^3/Pa", .doc = "added to both branches per prestress"});
}

template <class Visitor, class T>
void describe(Visitor& visit, PolycrystalOf<T>& p) {
  visit("method", p.method, {.required = true});
  visit("barrier_log_std", p.barrier_log_std, {.unit = "1", .min = 0, .max = 3});
  visit("interaction_field_std", p.interaction_field_std, {.unit = "V/m", .min = 0, .max = 1e8});
  visit("interaction_stress_std", p.interaction_stress_std, {.unit = "Pa", .min = 0, .max = 1e10});
  visit("bias_field", p.bias_field, {.unit = "V/m", .min = -1e8, .max = 1e8});
  visit("critical_force", p.critical_force, {.doc = "for the method \"parametrized\""});
}

template <class Visitor, class T>
void describe(Visitor& visit, ActuatorOf<T>& a) {
  visit("length", a.length, {.unit = "m", .min = 1e-9, .max = 10, .required = true, .doc = "active"});
  visit("area", a.area, {.unit = "m^2", .min = 1e-15, .max = 10, .required = true});
  visit("layer_thickness", a.layer_thickness, {.unit = "m", .min = 1e-9, .max = 1, .required = true});
  visit("layer_count", a.layer_count, {.unit = "1", .min = 1, .max = 1e6});
  visit("passive_stiffness", a.passive_stiffness,
        {.unit = "N/m", .min = 1, .doc = "of the non-active layers; null: rigid"});
}

template <class Visitor, class T>
void describe(Visitor& visit, LoadOf<T>& l) {
  visit("spring_stiffness", l.spring_stiffness,
        {.unit = "N/m", .min = 0, .max = spring_stiffness_max, .required = true});
  visit("prestress", l.prestress,
        {.unit = "Pa",
         .min = prestress_min,
         .max = prestress_max,
         .required = true,
         .doc = "compression positive"});
}

template <class T, class Function>
struct NumberVisitor {
  std::string path;
  Function& function;

  template <class Field>
  void operator()(std::string_view name, Field& field, const FieldInfo&) {
    if constexpr (std::is_same_v<Field, T>) function(path + std::string(name), field);
    if constexpr (std::is_same_v<Field, std::optional<T>>)
      if (field) function(path + std::string(name), *field);
    // A count of layers, where a plain model has it whole.
    if constexpr (std::is_same_v<Field, std::int64_t>) {
      T number = static_cast<T>(field);
      function(path + std::string(name), number);
      field = std::llround(number);
    }
  }
};

// function(path, T& number) for all numbers that a fit may move, by paths like "material.barrier" and
// "effects.electrostriction.coefficient".
template <class T, class Function>
void for_each_number(ModelOf<T>& model, Function&& function) {
  const auto visit = [&](const std::string& under, auto& part) {
    NumberVisitor<T, Function> visitor{under + ".", function};
    describe(visitor, part);
  };
  visit("material", model.material);
  visit("polycrystal", model.polycrystal);
  visit("actuator", model.actuator);
  visit("load", model.load);
  for (auto& effect : model.effects)
    for (auto& [name, value] : effect.parameters) function("effects." + effect.id + "." + name, value);
}

}  // namespace ferrobench::model
