// What surrounds the domains: amplifier, dielectric, mechanics and sensors, and what they remember of the
// last accepted step. The phase fractions come from the kinetics (physics/kinetics.h); both meet in the loads
// at a step's end.
//
// T is the type of numbers: double in the simulator, DualNumber in its forward sensitivities.
#pragma once

#include <algorithm>

#include "model/effects/catalogue.h"
#include "model/physics/kinetics.h"
#include "model/physics/lag.h"
#include "model/physics/mechanics.h"

namespace ferrobench::model {

// The cubic with values y0, y1 and slopes d0, d1 at the ends of a step of h, at u in [0, 1].
template <class T>
T cubic(const T& y0, const T& y1, const T& d0, const T& d1, const T& h, const std::type_identity_t<T>& u) {
  const T v = 1 - u;
  return v * v * (1 + 2 * u) * y0 + u * u * (1 + 2 * v) * y1 + h * u * v * (v * d0 - u * d1);
}

// A step that has been tried.
template <class T>
struct Trial {
  T h = 0;        // s
  T monitor = 0;  // V/m, at the end
  MeansOf<T> means;
  MaterialState<T> end;
  Equilibrium<T> equilibrium;
  T resistance_input = 0;
  T dissipation = 0;
};

// What is there, or is seen, at one time; units as in ChannelSpans.
template <class T>
struct Sensed {
  T time = 0;  // s
  T field = 0, charge = 0, displacement = 0, force = 0;
  T polarization = 0, strain = 0, stress = 0, fraction_plus = 0, fraction_minus = 0;
};

template <class T>
bool senses(const PortsOf<T>& ports) {
  return !ports.charge.empty() || !ports.displacement.empty() || !ports.force.empty();
}

// Puts in the place of what is there what its sensors make of it; before that, start(stage, its input).
template <class T, class Start>
void pass_sensors(PortsOf<T>& ports, Sensed<T>& there, Start&& start) {
  SensorInput<T> in{there.time, there.charge, there.field};
  const auto pass = [&](SensorStage<T>& stage) {
    start(stage, in);
    in.value = stage.update(in);
  };
  for (auto& stage : ports.charge) pass(*stage);
  there.charge = in.value;
  in.value = there.displacement;
  for (auto& stage : ports.displacement) pass(*stage.stage);
  there.displacement = in.value;
  in.value = there.force;
  for (auto& stage : ports.force) pass(*stage);
  there.force = in.value;
}
template <class T>
void pass_sensors(PortsOf<T>& ports, Sensed<T>& there) {
  pass_sensors(ports, there, [](SensorStage<T>&, const SensorInput<T>&) {});
}
// Sensors that have seen nothing before, or nothing that counts; their clock begins at 0.
template <class T>
void begin_to_sense(PortsOf<T>& ports, Sensed<T> there) {
  there.time = T(0);
  pass_sensors(ports, there, [](SensorStage<T>& stage, const SensorInput<T>& in) { stage.start(in); });
}

template <class T>
struct Surroundings {
  explicit Surroundings(ModelOf<T> given) : model(std::move(given)) {
    install_effects(model, ports);
    constants = kinetic_constants(model.material);
    constants.stress_stabilization = ports.stress_stabilization;
    constants.barrier_asymmetry = ports.barrier_asymmetry;
    constants.direct_rate = ports.direct_rate;
    constants.direct_barrier = ports.direct_barrier;
    mechanics.emplace(model, ports);
    by_rates = !vanishes(ports.domain_wall_drag) || !vanishes(ports.source_resistance);
    field_open = by_rates || std::any_of(ports.seen_by_rates.begin(), ports.seen_by_rates.end(),
                                         [](const auto& term) { return term->by_fractions(); });
    coupled = !mechanics->stress_is_constant() || field_open;
  }
  Surroundings(const Surroundings&) = delete;  // mechanics refers to ports
  Surroundings& operator=(const Surroundings&) = delete;

  ModelOf<T> model;
  PortsOf<T> ports;
  KineticConstantsOf<T> constants;
  std::optional<Mechanics<T>> mechanics;
  bool by_rates = false;    // the loads depend on the fractions' rates: drag or resistance
  bool field_open = false;  // the field that the rates see depends on the fractions or their rates
  bool coupled = false;     // the loads at a step's end depend on the fractions there

  // At the last accepted step.
  T monitor = 0;
  MaterialState<T> material;
  MeansOf<T> means;
  T plus_curvature = 0, minus_curvature = 0;  // second derivatives of the means, 1/s^2
  T dissipation = 0;                          // integral |dP_irr|, C/m^2
  T conducted = 0;                            // integral of the conduction current density, C/m^2
  T resistance_input = 0;  // of the lag that the source resistance makes with the permittivity

  // At rest with these fractions; the kinetics and the sensors start from it. A time below 0 if what follows
  // belongs to the specimen's past.
  void start(const T& command, const Fractions& fractions, double time) {
    monitor = command;
    for (auto& stage : ports.drive) monitor = stage->start(monitor);
    material = {};
    material.time = time;
    means = {fractions.plus, fractions.minus, 0, 0};
    fill(material, means, T(0), monitor);
    dissipation = conducted = plus_curvature = minus_curvature = T(0);
    mechanics->start(material);
    for (auto& term : ports.polarization) term->start(material);
    for (auto& term : ports.seen_by_rates) term->start(material);
    resistance_input = monitor;
  }
  // That the rates see at rest.
  LoadsOf<T> loads_at_start() const {
    return {material.field + added_for_rates(0, material), material.stress};
  }

  // The past is over: the specimen remembers it, time, charge and sensors begin.
  void begin_recording() {
    material.time = conducted = T(0);
    start_sensors();
  }

  void start_sensors() { begin_to_sense(ports, there(now(), 0)); }
  bool has_sensors() const { return senses(ports); }

  // A piece of commanded field as it comes out of the amplifier.
  std::vector<FieldPieceOf<T>> driven(const FieldPieceOf<T>& command) {
    std::vector<FieldPieceOf<T>> pieces{command}, transformed;
    for (auto& stage : ports.drive) {
      transformed.clear();
      for (const auto& piece : pieces) stage->transform(piece, transformed);
      std::swap(pieces, transformed);
    }
    return pieces;
  }

  T remanent(const T& dissipated) const {
    return vanishes(ports.fatigue)
               ? model.material.remanent_polarization
               : model.material.remanent_polarization * (1 / (1 + ports.fatigue * dissipated));
  }
  T permittivity(const MaterialState<T>& s) const {
    return model.material.permittivity_180 +
           (model.material.permittivity_90 - model.material.permittivity_180) * s.ninety();
  }
  T polarization(const MaterialState<T>& s, const T& dissipated) const {
    T p = permittivity(s) * s.field + model.material.piezoelectric_180 * (s.plus - s.minus) * s.stress +
          remanent(dissipated) * (s.plus - s.minus);
    for (const auto& term : ports.polarization) p += term->propose(s.time - material.time, s);
    return p;
  }
  T conduction(const T& field) const {
    T j = 0;
    for (const auto& term : ports.conduction) j += term(field);
    return j;
  }
  T charge(const T& density) const {
    return static_cast<T>(model.actuator.layer_count) * model.actuator.area * density;
  }
  // integral |dP_irr| once the means are these, without what fatigue takes of it.
  T dissipated_by(const MeansOf<T>& m) const {
    return dissipation +
           abs(model.material.remanent_polarization * ((m.plus - m.minus) - (means.plus - means.minus)));
  }

  void fill(MaterialState<T>& end, const MeansOf<T>& m, const T& h, const T& field) const {
    end.time = material.time + h;
    end.field = field;
    end.plus = m.plus;
    end.minus = m.minus;
    end.switched_polarization = model.material.remanent_polarization * (m.plus - m.minus);
  }

  // Means after h, as they went on so far.
  MeansOf<T> guess(const T& h) const {
    MeansOf<T> out;
    out.plus = std::clamp<T>(means.plus + h * (means.plus_rate + 0.5 * h * plus_curvature), 0, 1);
    out.minus =
        std::clamp<T>(means.minus + h * (means.minus_rate + 0.5 * h * minus_curvature), 0, 1 - out.plus);
    out.plus_rate = means.plus_rate + h * plus_curvature;
    out.minus_rate = means.minus_rate + h * minus_curvature;
    return out;
  }

  // What the rates do not see of the field across the material.
  T drag(const MeansOf<T>& m) const {
    return ports.domain_wall_drag * remanent(dissipation) * (m.plus_rate - m.minus_rate);
  }

  // What they see besides it, h after the last accepted state.
  T added_for_rates(const T& h, const MaterialState<T>& end) const {
    T sum = 0;
    for (const auto& term : ports.seen_by_rates) sum += term->propose(h, end);
    return sum;
  }

  // Field across the material at the end of a trial if the rates see `seen` there: E + terms(E) = seen +
  // drag.
  T across(const Trial<T>& trial, const MeansOf<T>& m, const T& seen) const {
    const T target = seen + drag(m);
    if (ports.seen_by_rates.empty()) return target;
    if (vanishes(ports.source_resistance)) return trial.monitor;
    auto end = trial.end;
    fill(end, m, trial.h, end.field);
    return root<T>(value_of(target), 1e-12 * field_scale(), [&](const T& field) {
      end.field = field;
      return field + added_for_rates(trial.h, end) - target;
    });
  }

  // Field across the material at the end of a trial, behind the source resistance: E + r dP/dt = E_mon as a
  // lag with the permittivity at the step's start. Of the rest of P what switches goes by its rate at the
  // end, all else by its change over the step, taken with the field and stress that the trial has so far.
  T behind_resistance(Trial<T>& trial, const MeansOf<T>& m) const {
    if (vanishes(ports.source_resistance)) return trial.monitor;
    const T r = ports.source_resistance, kappa = permittivity(material);
    const T switched = remanent(dissipation) * ((m.plus - m.minus) - (means.plus - means.minus));
    const T change = polarization(trial.end, dissipated_by(m)) - polarization(material, dissipation) -
                     kappa * (trial.end.field - material.field) - switched;
    const T rate =
        remanent(dissipation) * (m.plus_rate - m.minus_rate) + (trial.h > 0 ? change / trial.h : T(0));
    trial.resistance_input = trial.monitor - r * rate;
    return lag<T>(material.field, resistance_input, trial.resistance_input, trial.h, r * kappa);
  }

  // The loads that the rates see at the end of a trial whose means are `m`. Field and stress of trial.end are
  // those that the trial has so far.
  LoadsOf<T> loads_after(Trial<T>& trial, const MeansOf<T>& m) const {
    fill(trial.end, m, trial.h, trial.end.field);
    trial.end.field = behind_resistance(trial, m);
    trial.equilibrium = mechanics->propose(trial.h, trial.end);
    return {trial.end.field - drag(m) + added_for_rates(trial.h, trial.end), trial.end.stress};
  }

  // Stress that changes ln(rate) by about 1, and field.
  double stress_scale() const { return 1 / value_of(constants.inverse_energy * abs(constants.strain_90)); }
  double field_scale() const { return 1 / value_of(constants.inverse_energy * constants.polarization); }

  // How far the stress at mid-step is off the line between the step's ends, by the fractions' cubic.
  LoadsOf<T> bend(const Trial<T>& trial) const {
    MaterialState<T> middle = material;
    MeansOf<T> m;
    const auto& end = trial.means;
    m.plus = cubic<T>(means.plus, end.plus, means.plus_rate, end.plus_rate, trial.h, 0.5);
    m.minus = cubic<T>(means.minus, end.minus, means.minus_rate, end.minus_rate, trial.h, 0.5);
    fill(middle, m, 0.5 * trial.h, 0.5 * (material.field + trial.end.field));
    mechanics->propose(0.5 * trial.h, middle);
    const double limit = 0.5 * stress_scale();
    return {0, std::clamp<T>(middle.stress - 0.5 * (material.stress + trial.end.stress), -limit, limit)};
  }

  // The last accepted state as a step that takes no time.
  Trial<T> now() const {
    Trial<T> out;
    out.means = means;
    out.end = material;
    out.equilibrium = mechanics->propose(0, out.end);
    out.monitor = monitor;
    out.dissipation = dissipation;
    return out;
  }

  // A held field or a new slope: what curved before says nothing of what comes.
  void turn() { plus_curvature = minus_curvature = T(0); }

  void accept(Trial<T>& trial) {
    const auto& m = trial.means;
    plus_curvature = (m.plus_rate - means.plus_rate) / trial.h;
    minus_curvature = (m.minus_rate - means.minus_rate) / trial.h;
    dissipation = trial.dissipation;
    conducted += 0.5 * trial.h * (conduction(material.field) + conduction(trial.end.field));
    mechanics->accept(trial.h, trial.end);
    for (auto& term : ports.polarization) term->accept(trial.h, trial.end);
    for (auto& term : ports.seen_by_rates) term->accept(trial.h, trial.end);
    material = trial.end;
    means = m;
    monitor = trial.monitor;
    resistance_input = trial.resistance_input;
  }

  // What sensors would see at `since` seconds into the trial (from the last accepted state).
  Sensed<T> there(const Trial<T>& trial, const T& since) const {
    const T u = trial.h > 0 ? since / trial.h : T(1);
    MaterialState<T> s = trial.end;
    s.time = material.time + since;
    s.plus = cubic(means.plus, trial.means.plus, means.plus_rate, trial.means.plus_rate, trial.h, u);
    s.minus = cubic(means.minus, trial.means.minus, means.minus_rate, trial.means.minus_rate, trial.h, u);
    s.field = material.field + u * (trial.end.field - material.field);
    s.switched_polarization = model.material.remanent_polarization * (s.plus - s.minus);
    const auto e = u == 1 ? trial.equilibrium : mechanics->propose(since, s);
    if (u == 1) s = trial.end;
    const T dissipated = dissipation + u * (trial.dissipation - dissipation);
    const T current = 0.5 * since * (conduction(material.field) + conduction(s.field));

    Sensed<T> out;
    out.time = s.time;
    out.field = monitor + u * (trial.monitor - monitor);
    out.polarization = polarization(s, dissipated);
    out.charge = charge(out.polarization + (conducted + current));
    out.displacement = e.displacement;
    out.force = e.force;
    out.strain = e.strain;
    out.stress = s.stress;
    out.fraction_plus = s.plus;
    out.fraction_minus = s.minus;
    return out;
  }

  // The channels at that time. Sensors remember it.
  Sensed<T> sense(const Trial<T>& trial, const T& since) {
    auto out = there(trial, since);
    pass_sensors(ports, out);
    return out;
  }
};

}  // namespace ferrobench::model
