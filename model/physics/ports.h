// The places where an effect can act, and what it may do there. The simulator asks every port in each step; a
// port that nothing is plugged into leaves the base model as it is, bit for bit.
//
// Whatever has a memory works in two steps: propose() says what would be after `h` seconds and keeps nothing,
// accept() moves the memory there. Inputs go linearly from the last accepted state to the one given.
//
// T is the type of numbers: double, or a Dual, whose tangents are the derivatives by the model's parameters.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "model/model.h"
#include "model/physics/dual.h"

namespace ferrobench::model {

// The material at one time.
template <class T>
struct MaterialState {
  T time = 0;    // s
  T field = 0;   // V/m, across the material
  T stress = 0;  // Pa
  T plus = 1, minus = 0;
  T switched_polarization = 0;  // P_irr = P_+ (x+ - x-), C/m^2
  T instant_strain = 0;         // strain since rest, without delayed terms
  T ninety() const { return 1 - plus - minus; }
};

// A linear stretch of field in time.
template <class T>
struct FieldPieceOf {
  T duration = 0;      // s
  T from = 0, to = 0;  // V/m
};
using FieldPiece = FieldPieceOf<double>;

// drive: commanded field in, field at the amplifier's monitor out, both piecewise linear. What start() gives
// is the output for a field that has been there long.
template <class T>
class DriveStage {
 public:
  virtual ~DriveStage() = default;
  virtual T start(const T& field) = 0;
  // Appends to `out` pieces of the same total duration.
  virtual void transform(const FieldPieceOf<T>& in, std::vector<FieldPieceOf<T>>& out) = 0;
};

// strain, polarization, seen_by_rates: a term that follows from what the material goes through. In the
// strain, `instant` terms count in MaterialState::instant_strain, delayed ones do not.
template <class T>
class MaterialTerm {
 public:
  virtual ~MaterialTerm() = default;
  virtual bool instant() const { return false; }
  // Whether it may depend on the stress, or on the fractions, of the state that is proposed.
  virtual bool by_stress() const { return true; }
  virtual bool by_fractions() const { return true; }
  virtual void start(const MaterialState<T>& at) = 0;
  virtual T propose(const T& h, const MaterialState<T>& end) const = 0;
  virtual void accept(const T& h, const MaterialState<T>& end) = 0;
};

// spring: a length added to the extension that the spring answers to, by where the extension has been.
// Between two calls it does not turn.
template <class T>
class SpringTerm {
 public:
  virtual ~SpringTerm() = default;
  virtual void start() = 0;                         // at no extension
  virtual T propose(const T& extension) const = 0;  // m
  virtual void accept(const T& extension) = 0;
};

// charge, displacement, force: what the sensor makes of the true value.
template <class T>
struct SensorInput {
  T time = 0;           // s
  T value = 0;          // of the stage before
  T monitor_field = 0;  // V/m
};
template <class T>
class SensorStage {
 public:
  virtual ~SensorStage() = default;
  virtual void start(const SensorInput<T>& in) = 0;
  virtual T update(const SensorInput<T>& in) = 0;
};

// The sensor chain of the displacement has a fixed order; stages are sorted by it.
enum class SensorOrder { nonlinearity, crosstalk_and_drift, lag, pickup, delay, clipping };
template <class T>
struct OrderedStage {
  SensorOrder order = SensorOrder::nonlinearity;
  std::unique_ptr<SensorStage<T>> stage;
};

template <class T>
struct Inertia {
  T mass = 0;           // kg
  T damping_ratio = 0;  // 1
};
template <class T>
struct Friction {
  T force = 0;                // N
  T presliding_distance = 0;  // m
};

template <class T>
struct PortsOf {
  std::vector<std::unique_ptr<DriveStage<T>>> drive;
  T source_resistance = 0;  // V s m/C: E = E_mon - this * Pdot
  // kinetics
  T stress_stabilization = 0;  // 1/Pa
  T barrier_asymmetry = 0;     // KineticConstants (physics/wells.h) has
  T direct_rate = 0;           // these three; a rate of 0: no direct
  T direct_barrier = 1;        // switching
  T spread_skewness = 0;       // SpreadShape (physics/domains.h) has both
  T spread_inverse_freedom = 0;
  T domain_wall_drag = 0;                                       // V s m/C: rates see E - this * Pdot_irr
  T fatigue = 0;                                                // m^2/C: P_+ / (1 + this * integral |dP_irr|)
  std::vector<std::unique_ptr<MaterialTerm<T>>> seen_by_rates;  // added to the E that rates see, V/m
  // polarization: added to P, C/m^2
  std::vector<std::unique_ptr<MaterialTerm<T>>> polarization;
  // conduction: added to the charge as a current density, A/m^2, as a function of the field
  std::vector<std::function<T(const T& field)>> conduction;
  std::vector<std::unique_ptr<MaterialTerm<T>>> strain;
  // equilibrium
  std::vector<std::function<T(const T& extension)>> spring_extension;  // x that the spring sees, m
  std::vector<std::function<T(const T& extension)>> spring_hardening;  // factor on k x
  std::vector<std::unique_ptr<SpringTerm<T>>> spring;                  // added to the x that gives k x, m
  std::function<T(const T& time)> prestress_factor;                    // sigma_pre(t) / sigma_pre
  std::optional<Friction<T>> friction;
  std::optional<Inertia<T>> inertia;
  // sensing
  std::vector<std::unique_ptr<SensorStage<T>>> charge, force;
  std::vector<OrderedStage<T>> displacement;
};
using Ports = PortsOf<double>;

}  // namespace ferrobench::model
