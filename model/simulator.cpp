#include "model/simulator.h"

#include <algorithm>
#include <cmath>

#include "model/effects/catalogue.h"
#include "model/physics/coupling.h"
#include "model/physics/ensemble.h"
#include "model/physics/lag.h"
#include "model/physics/mechanics.h"
#include "model/physics/parametrized.h"

namespace ferrobench::model {
namespace {

// The step controller looks at how far the fractions' means are from the trapezoidal rule over their own
// rates. That is about this many times the error that the step leaves behind; held to by tests.
constexpr double error_per_defect = 0.2;

// Where a well ends (F = 4 dg0) ln(rate) stops being a parabola, and the step that goes across takes it as
// straight. A domain that is still in its well then switches late by up to this share of the step, which the
// trapezoidal rule over means does not see.
constexpr double late_at_the_end = 1.0 / 24;

double cubic(double y0, double y1, double d0, double d1, double h, double u) {
  const double v = 1 - u;
  return v * v * (1 + 2 * u) * y0 + u * u * (1 + 2 * v) * y1 + h * u * v * (v * d0 - u * d1);
}

std::unique_ptr<Kinetics> make_kinetics(const Model& model, const KineticConstants& constants,
                                        const SimulationOptions& options) {
  if (model.polycrystal.method == PolycrystalMethod::parametrized)
    return std::make_unique<Parametrized>(model, constants);
  const int count = options.domains > 0 ? options.domains
                                        : domains_for(model.material, model.polycrystal, options.tolerance);
  return std::make_unique<Ensemble>(
      make_domains(model.material, model.polycrystal, count, options.shift, options.every_spread), constants,
      0.1 * options.tolerance);
}

}  // namespace

struct Simulator::State {
  State(Model given, const SimulationOptions& given_options)
      : model(std::move(given)), options(given_options) {
    install_effects(model, ports);
    constants = kinetic_constants(model.material);
    constants.stress_stabilization = ports.stress_stabilization;
    mechanics = std::make_unique<Mechanics>(model, ports);
    kinetics = make_kinetics(model, constants, options);
    coupled = !mechanics->stress_is_constant() || ports.domain_wall_drag != 0 || ports.source_resistance != 0;
  }

  Model model;
  SimulationOptions options;
  Ports ports;
  KineticConstants constants;
  std::unique_ptr<Mechanics> mechanics;
  std::unique_ptr<Kinetics> kinetics;
  Coupling coupling;
  bool coupled = false;

  // At the last accepted step.
  double command = 0, monitor = 0;
  MaterialState material;
  Means means;
  double plus_curvature = 0, minus_curvature = 0;  // second derivatives of the means, 1/s^2
  double dissipation = 0;                          // integral |dP_irr|, C/m^2
  double conducted = 0;                            // integral of the conduction current density, C/m^2
  double resistance_input = 0;  // of the lag that the source resistance makes with the permittivity
  double next_step = 0;
  std::size_t sensed = 0;  // outputs done in this call
  SimulationStatistics statistics;
  double squared_error = 0;
  std::vector<FieldPiece> pieces, transformed;

  // A step that has been tried.
  struct Trial {
    double h = 0;
    double monitor = 0;
    Means means;
    MaterialState end;
    Equilibrium equilibrium;
    double resistance_input = 0;
    double dissipation = 0;
  };

  double polarization_scale(double dissipated) const { return 1 / (1 + ports.fatigue * dissipated); }
  double remanent(double dissipated) const {
    return ports.fatigue == 0 ? model.material.remanent_polarization
                              : model.material.remanent_polarization * polarization_scale(dissipated);
  }
  double permittivity(const MaterialState& s) const {
    return model.material.permittivity_180 +
           (model.material.permittivity_90 - model.material.permittivity_180) * s.ninety();
  }

  double polarization(const MaterialState& s, double dissipated) const {
    double p = permittivity(s) * s.field + model.material.piezoelectric_180 * (s.plus - s.minus) * s.stress +
               remanent(dissipated) * (s.plus - s.minus);
    for (const auto& term : ports.polarization) p += term(s.field);
    return p;
  }

  double conduction(double field) const {
    double j = 0;
    for (const auto& term : ports.conduction) j += term(field);
    return j;
  }

  void start(double field) {
    command = field;
    monitor = field;
    for (auto& stage : ports.drive) stage->start(field);
    material = {};
    means = {};
    fill(material, means, 0, field);
    dissipation = conducted = plus_curvature = minus_curvature = 0;
    next_step = 0;
    statistics = {};
    squared_error = 0;
    mechanics->start(material);
    kinetics->set_polarization(remanent(0));
    kinetics->start({material.field, material.stress});
    means = kinetics->means();
    resistance_input = field;
    coupling.reset();
    start_sensors();
  }

  void start_sensors() {
    auto at = material;
    const auto e = mechanics->propose(0, at);
    SensorInput in{0, charge(at, dissipation, conducted), monitor};
    for (auto& stage : ports.charge) {
      stage->start(in);
      in.value = stage->update(in);
    }
    in.value = e.displacement;
    for (auto& stage : ports.displacement) {
      stage.stage->start(in);
      in.value = stage.stage->update(in);
    }
    in.value = e.force;
    for (auto& stage : ports.force) {
      stage->start(in);
      in.value = stage->update(in);
    }
  }

  double charge(const MaterialState& s, double dissipated, double conducted_so_far) const {
    return static_cast<double>(model.actuator.layer_count) * model.actuator.area *
           (polarization(s, dissipated) + conducted_so_far);
  }

  // Path of ln(rate) per second at most, for a field that changes at `slew`.
  double path_rate(double slew) const {
    return constants.inverse_energy *
           (constants.polarization + std::abs(constants.piezoelectric * material.stress)) * std::abs(slew);
  }

  void fill(MaterialState& end, const Means& m, double h, double field) const {
    end.time = material.time + h;
    end.field = field;
    end.plus = m.plus;
    end.minus = m.minus;
    end.switched_polarization = model.material.remanent_polarization * (m.plus - m.minus);
  }

  // Field across the material at the end of a trial, behind the source resistance: E + r dP/dt = E_mon as a
  // lag with the permittivity at the step's start. Of the rest of P what switches goes by its rate at the
  // end, all else by its change over the step, taken with the field and stress that the trial has so far.
  double behind_resistance(Trial& trial, const Means& m) const {
    if (ports.source_resistance == 0) return trial.monitor;
    const double r = ports.source_resistance, kappa = permittivity(material);
    const double order = m.plus - m.minus, before = means.plus - means.minus;
    const double dissipated = dissipation + std::abs(model.material.remanent_polarization * (order - before));
    const double switched = remanent(dissipation) * (order - before);
    const double change = polarization(trial.end, dissipated) - polarization(material, dissipation) -
                          kappa * (trial.end.field - material.field) - switched;
    const double rate =
        remanent(dissipation) * (m.plus_rate - m.minus_rate) + (trial.h > 0 ? change / trial.h : 0);
    trial.resistance_input = trial.monitor - r * rate;
    return lag(material.field, resistance_input, trial.resistance_input, trial.h, r * kappa);
  }

  // How far the stress at mid-step is off the line between the step's ends, by the fractions' cubic.
  Loads bend(const Trial& trial, double per_stress) const {
    MaterialState middle = material;
    Means m;
    const auto& end = trial.means;
    m.plus = cubic(means.plus, end.plus, means.plus_rate, end.plus_rate, trial.h, 0.5);
    m.minus = cubic(means.minus, end.minus, means.minus_rate, end.minus_rate, trial.h, 0.5);
    fill(middle, m, 0.5 * trial.h, 0.5 * (material.field + trial.end.field));
    mechanics->propose(0.5 * trial.h, middle);
    const double limit = 0.5 / per_stress;
    return {0, std::clamp(middle.stress - 0.5 * (material.stress + trial.end.stress), -limit, limit)};
  }

  // Solves the step's end: the loads that the kinetics see must be those that the fractions bring about.
  bool solve(Trial& trial) {
    const double h = trial.h;
    Means guess;
    guess.plus = std::clamp(means.plus + h * (means.plus_rate + 0.5 * h * plus_curvature), 0.0, 1.0);
    guess.minus =
        std::clamp(means.minus + h * (means.minus_rate + 0.5 * h * minus_curvature), 0.0, 1.0 - guess.plus);
    guess.plus_rate = means.plus_rate + h * plus_curvature;
    guess.minus_rate = means.minus_rate + h * minus_curvature;
    const auto drag = [&](const Means& m) {
      return ports.domain_wall_drag * remanent(dissipation) * (m.plus_rate - m.minus_rate);
    };
    const auto loads_after = [&](const Means& m) {
      fill(trial.end, m, h, trial.end.field);
      trial.end.field = behind_resistance(trial, m);
      trial.equilibrium = mechanics->propose(h, trial.end);
      return Loads{trial.end.field - drag(m), trial.end.stress};
    };
    if (ports.fatigue != 0)
      kinetics->set_polarization(
          remanent(dissipation + std::abs(model.material.remanent_polarization *
                                          ((guess.plus - guess.minus) - (means.plus - means.minus)))));
    trial.end = material;
    trial.end.field = trial.monitor;
    const Loads first = loads_after(guess);
    if (!coupled) {
      trial.means = kinetics->propose(h, first, {});
      loads_after(trial.means);
      return true;
    }
    trial.means = guess;
    const double per_stress = constants.inverse_energy * std::abs(constants.strain_90);
    const double per_field = constants.inverse_energy * constants.polarization;
    // Behind drag or resistance the loads follow from rates, which mean fractions that hardly move do not
    // bound.
    const bool by_rates = ports.domain_wall_drag != 0 || ports.source_resistance != 0;
    const double agreement = by_rates ? 1e-3 : std::numeric_limits<double>::infinity();
    return coupling.solve(
        first, {1 / per_field, 1 / per_stress}, 0.05 * options.tolerance, agreement, [&](const Loads& at) {
          trial.means = kinetics->propose(h, at, bend(trial, per_stress));
          trial.end.field = at.field + drag(trial.means);
          trial.end.stress = at.stress;
          return Coupling::Answer{loads_after(trial.means), trial.means.plus, trial.means.minus};
        });
  }

  double defect(const Trial& trial) const {
    const auto& m = trial.means;
    const double plus = m.plus - means.plus - 0.5 * trial.h * (means.plus_rate + m.plus_rate);
    const double minus = m.minus - means.minus - 0.5 * trial.h * (means.minus_rate + m.minus_rate);
    return std::max({std::abs(plus), std::abs(minus), std::abs(plus + minus)});
  }

  // The ends of wells as a piece of field passes them. With ln(rate) = -c^2 t^2 / 2 before the end at t = 0,
  // the share exp(-sqrt(pi / 2) / (c tau)) of the domains is still there: next to none where tau is short.
  struct WellEnds {
    double sharpness = 0;  // c, 1/s
    double reached = 0;    // share of the domains
  };
  WellEnds well_ends(double path) const {
    if (path == 0) return {};
    const double c = path / std::sqrt(8 * constants.inverse_energy * model.material.barrier);
    return {c, std::exp(-1.25 / (c * constants.relaxation_time))};
  }

  // What the trial leaves behind of the fractions' means, as an estimate.
  double step_error(const Trial& trial, const WellEnds& ends) const {
    const double plus = trial.means.plus - means.plus, minus = trial.means.minus - means.minus;
    const double switched = std::max({std::abs(plus), std::abs(minus), std::abs(plus + minus)});
    const double late = late_at_the_end * ends.reached * std::min(1.0, trial.h * ends.sharpness);
    return std::max(error_per_defect * defect(trial), late * switched);
  }

  void accept(Trial& trial) {
    kinetics->accept();
    const auto& m = trial.means;
    plus_curvature = (m.plus_rate - means.plus_rate) / trial.h;
    minus_curvature = (m.minus_rate - means.minus_rate) / trial.h;
    dissipation = trial.dissipation;
    conducted += 0.5 * trial.h * (conduction(material.field) + conduction(trial.end.field));
    mechanics->accept(trial.h, trial.end);
    material = trial.end;
    means = m;
    monitor = trial.monitor;
    resistance_input = trial.resistance_input;
    ++statistics.steps;
    statistics.domain_steps = kinetics->domain_steps();
    statistics.time_error = std::sqrt(squared_error / std::max(1e-300, material.time));
  }

  // The channels at `since` seconds into the trial (from the last accepted state).
  void output(const Trial& trial, double since, std::size_t row, const ChannelSpans* out) {
    const double u = trial.h > 0 ? since / trial.h : 1;
    MaterialState s = trial.end;
    s.time = material.time + since;
    s.plus = cubic(means.plus, trial.means.plus, means.plus_rate, trial.means.plus_rate, trial.h, u);
    s.minus = cubic(means.minus, trial.means.minus, means.minus_rate, trial.means.minus_rate, trial.h, u);
    s.field = material.field + u * (trial.end.field - material.field);
    s.switched_polarization = model.material.remanent_polarization * (s.plus - s.minus);
    const auto e = u == 1 ? trial.equilibrium : mechanics->propose(since, s);
    if (u == 1) s = trial.end;
    const double dissipated = dissipation + u * (trial.dissipation - dissipation);
    const double current = 0.5 * since * (conduction(material.field) + conduction(s.field));
    const double seen = monitor + u * (trial.monitor - monitor);

    SensorInput in{s.time, charge(s, dissipated, conducted + current), seen};
    for (auto& stage : ports.charge) in.value = stage->update(in);
    const double q = in.value;
    in.value = e.displacement;
    for (auto& stage : ports.displacement) in.value = stage.stage->update(in);
    const double x = in.value;
    in.value = e.force;
    for (auto& stage : ports.force) in.value = stage->update(in);
    if (out == nullptr) return;
    const auto put = [row](std::span<double> column, double value) {
      if (!column.empty()) column[row] = value;
    };
    put(out->field, seen);
    put(out->charge, q);
    put(out->displacement, x);
    put(out->force, in.value);
    put(out->stress, s.stress);
    put(out->strain, e.strain);
    put(out->fraction_plus, s.plus);
    put(out->fraction_minus, s.minus);
    if (!out->polarization.empty()) out->polarization[row] = polarization(s, dissipated);
  }

  void sense(const Trial& trial, std::span<const double> times, const ChannelSpans& out, double piece_end) {
    const double end = material.time + trial.h;
    // The last time of a piece may miss its end by rounding.
    const double slack = 1e-12 * std::max(1.0, std::abs(piece_end));
    // Sensors take what they see as linear from one time to the next, which a whole step of switching is not.
    const bool sensors = !ports.charge.empty() || !ports.displacement.empty() || !ports.force.empty();
    constexpr int parts = 4;
    int part = 1;
    const auto watch = [&](double until) {
      for (; sensors && part < parts && material.time + part * trial.h / parts < until - slack; ++part)
        output(trial, part * trial.h / parts, 0, nullptr);
    };
    while (sensed < times.size() && times[sensed] <= end + slack) {
      watch(times[sensed]);
      output(trial, std::clamp(times[sensed] - material.time, 0.0, trial.h), sensed, &out);
      ++sensed;
    }
    watch(end);
    if (sensors && (sensed == 0 || times.empty() || times[sensed - 1] < end - slack))
      output(trial, trial.h, 0, nullptr);
  }

  void play_piece(const FieldPiece& piece, std::span<const double> times, const ChannelSpans& out) {
    const double start_time = material.time, piece_end = start_time + piece.duration;
    const double slew = (piece.to - piece.from) / piece.duration;
    const double path = path_rate(slew);
    const WellEnds ends = well_ends(path);
    double step = next_step > 0 ? next_step : constants.relaxation_time;
    if (path > 0) step = std::min(step, 20 / path);
    double done = 0;
    // A held field or a new slope: what curved before says nothing of what comes.
    plus_curvature = minus_curvature = 0;
    int rejections = 0;
    while (done < piece.duration) {
      const double remaining = piece.duration - done;
      double h = std::min(step, mechanics->largest_step(slew));
      const bool last = h > 0.8 * remaining;
      if (last && h < remaining) h = h > remaining / 1.2 ? remaining : remaining / 2;
      if (h >= remaining) h = remaining;
      check_stop(options);
      if (options.most_steps > 0 && statistics.tried >= options.most_steps)
        throw Error(ErrorCode::numerical, "the model wants more than " + std::to_string(options.most_steps) +
                                              " steps by t = " + std::to_string(material.time) + " s");
      ++statistics.tried;
      Trial trial;
      trial.h = h;
      trial.monitor = h == remaining ? piece.to : piece.from + slew * (done + h);
      const bool solved = solve(trial);
      const double error = solved ? step_error(trial, ends) : std::numeric_limits<double>::infinity();
      const double ratio = error / options.tolerance;
      if (!solved || !(ratio <= 2)) {
        if (++rejections > 200 || h < 1e-15 * std::max(1.0, material.time))
          throw Error(ErrorCode::numerical,
                      "the model does not converge at t = " + std::to_string(material.time) + " s");
        step = h * (solved ? std::max(0.2, 0.9 * std::cbrt(1 / ratio)) : 0.25);
        continue;
      }
      rejections = 0;
      trial.dissipation =
          dissipation + std::abs(model.material.remanent_polarization *
                                 ((trial.means.plus - trial.means.minus) - (means.plus - means.minus)));
      squared_error += error * error * h;
      sense(trial, times, out, piece_end);
      accept(trial);
      done = h == remaining ? piece.duration : done + h;
      const double grown = h * std::min(2.5, 0.9 * std::cbrt(1 / std::max(ratio, 1e-3)));
      step = h == remaining ? std::max(step, grown) : grown;
    }
    material.time = piece_end;
    next_step = step;
  }
};

void check_stop(const SimulationOptions& options) {
  if (options.stop != nullptr && (*options.stop)())
    throw Error(ErrorCode::cancelled, "the simulation was stopped");
}

Simulator::Simulator(const Model& model, const SimulationOptions& options)
    : state_(std::make_unique<State>(model, options)) {}
Simulator::~Simulator() = default;
Simulator::Simulator(Simulator&&) noexcept = default;
Simulator& Simulator::operator=(Simulator&&) noexcept = default;

void Simulator::start(double field) {
  state_->start(field);
}
double Simulator::time() const {
  return state_->material.time;
}
double Simulator::field() const {
  return state_->command;
}
const SimulationStatistics& Simulator::statistics() const {
  return state_->statistics;
}

void Simulator::play(double duration, double field, std::span<const double> times, const ChannelSpans& out) {
  auto& s = *state_;
  s.sensed = 0;
  while (s.sensed < times.size() && times[s.sensed] <= s.material.time) {
    State::Trial at;
    at.means = s.means;
    at.end = s.material;
    at.equilibrium = s.mechanics->propose(0, at.end);
    at.monitor = s.monitor;
    at.dissipation = s.dissipation;
    s.output(at, 0, s.sensed++, &out);
  }
  if (duration <= 0) return;
  s.pieces.assign(1, {duration, s.command, field});
  for (auto& stage : s.ports.drive) {
    s.transformed.clear();
    for (const auto& piece : s.pieces) stage->transform(piece, s.transformed);
    std::swap(s.pieces, s.transformed);
  }
  for (const auto& piece : s.pieces) s.play_piece(piece, times, out);
  s.command = field;
}

}  // namespace ferrobench::model
