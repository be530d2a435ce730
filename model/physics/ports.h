// The places where an effect can act, and what it may do there. The simulator asks every port in each step; a
// port that nothing is plugged into leaves the base model as it is, bit for bit.
//
// Whatever has a memory works in two steps: propose() says what would be after `h` seconds and keeps nothing,
// accept() moves the memory there. Inputs go linearly from the last accepted state to the one given.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "model/model.h"

namespace ferrobench::model {

// The material at one time.
struct MaterialState {
  double time = 0;    // s
  double field = 0;   // V/m, across the material
  double stress = 0;  // Pa
  double plus = 1, minus = 0;
  double switched_polarization = 0;  // P_irr = P_+ (x+ - x-), C/m^2
  double instant_strain = 0;         // strain since rest, without delayed terms
  double ninety() const { return 1 - plus - minus; }
};

// A linear stretch of field in time.
struct FieldPiece {
  double duration = 0;      // s
  double from = 0, to = 0;  // V/m
};

// drive: commanded field in, field at the amplifier's monitor out, both piecewise linear.
class DriveStage {
 public:
  virtual ~DriveStage() = default;
  virtual void start(double field) = 0;
  // Appends to `out` pieces of the same total duration.
  virtual void transform(const FieldPiece& in, std::vector<FieldPiece>& out) = 0;
};

// strain: a term added to the strain. `instant` terms count in MaterialState::instant_strain, delayed ones do
// not.
class StrainTerm {
 public:
  virtual ~StrainTerm() = default;
  virtual bool instant() const { return false; }
  virtual void start(const MaterialState& at) = 0;
  virtual double propose(double h, const MaterialState& end) const = 0;
  virtual void accept(double h, const MaterialState& end) = 0;
};

// charge, displacement, force: what the sensor makes of the true value.
struct SensorInput {
  double time = 0;           // s
  double value = 0;          // of the stage before
  double monitor_field = 0;  // V/m
};
class SensorStage {
 public:
  virtual ~SensorStage() = default;
  virtual void start(const SensorInput& in) = 0;
  virtual double update(const SensorInput& in) = 0;
};

// The sensor chain of the displacement has a fixed order; stages are sorted by it.
enum class SensorOrder { nonlinearity, crosstalk_and_drift, lag, pickup, delay, clipping };
struct OrderedStage {
  SensorOrder order = SensorOrder::nonlinearity;
  std::unique_ptr<SensorStage> stage;
};

struct Inertia {
  double mass = 0;           // kg
  double damping_ratio = 0;  // 1
};
struct Friction {
  double force = 0;                // N
  double presliding_distance = 0;  // m
};

struct Ports {
  std::vector<std::unique_ptr<DriveStage>> drive;
  double source_resistance = 0;  // V s m/C: E = E_mon - this * Pdot
  // kinetics
  double stress_stabilization = 0;  // 1/Pa
  double domain_wall_drag = 0;      // V s m/C: rates see E - this * Pdot_irr
  double fatigue = 0;               // m^2/C: P_+ / (1 + this * integral |dP_irr|)
  // polarization: added to P, C/m^2, as a function of the field
  std::vector<std::function<double(double field)>> polarization;
  // conduction: added to the charge as a current density, A/m^2, as a function of the field
  std::vector<std::function<double(double field)>> conduction;
  std::vector<std::unique_ptr<StrainTerm>> strain;
  // equilibrium
  std::vector<std::function<double(double extension)>> spring_extension;  // x that the spring sees, m
  std::vector<std::function<double(double extension)>> spring_hardening;  // factor on k x
  std::function<double(double time)> prestress_factor;                    // sigma_pre(t) / sigma_pre
  std::optional<Friction> friction;
  std::optional<Inertia> inertia;
  // sensing
  std::vector<std::unique_ptr<SensorStage>> charge, force;
  std::vector<OrderedStage> displacement;
};

}  // namespace ferrobench::model
