#include "model/forward_sensitivities.h"

#include <Eigen/Dense>
#include <algorithm>
#include <map>

#include "model/model_fields.h"
#include "model/wide_surroundings.h"

namespace ferrobench::model {
namespace {

constexpr std::array<std::size_t, 3> load_directions{field_direction, stress_direction, bend_direction};

}  // namespace

ModelOf<DualNumber> with_tangents(const Model& model, std::span<const std::string> parameters) {
  ModelOf<DualNumber> out;
  out.material.barrier_law = model.material.barrier_law;
  out.polycrystal.method = model.polycrystal.method;
  out.polycrystal.critical_force = model.polycrystal.critical_force;
  if (model.actuator.passive_stiffness) out.actuator.passive_stiffness = 0;
  for (const auto& effect : model.effects) {
    out.effects.push_back({effect.id, {}});
    for (const auto& [name, value] : effect.parameters) out.effects.back().parameters.emplace_back(name, 0);
  }
  std::map<std::string, double> values;
  Model plain = model;
  for_each_number(plain, [&](const std::string& path, double value) { values[path] = value; });
  for_each_number(out, [&](const std::string& path, DualNumber& number) { number = values.at(path); });
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (!values.contains(parameters[i]))
      throw Error(ErrorCode::invalid_params, "the model has no such number",
                  Problem{.path = parameters[i], .message = "is not a number of this model"});
    for_each_number(out, [&](const std::string& path, DualNumber& number) {
      if (path == parameters[i]) number.tangent.at(i) = 1;
    });
  }
  return out;
}

ForwardSensitivities::ForwardSensitivities(Simulator::State& state, const Model& model,
                                           std::span<const std::string> parameters, const SlopeSpans& out,
                                           const DriveDirections& drive)
    : state_(state),
      drive_(drive),
      parameters_(parameters.size() + drive.count),
      first_direction_(parameters.size()),
      out_(out) {
  for (std::size_t first = 0; first < parameters_; first += parameter_directions) {
    const std::size_t count = std::min(parameter_directions, parameters_ - first);
    const std::size_t begin = std::min(first, parameters.size());
    auto part = std::make_unique<Part>(
        with_tangents(model, parameters.subspan(begin, std::min(count, parameters.size() - begin))));
    part->first = first;
    part->count = count;
    if (state.ensemble == nullptr) part->law.emplace(part->around.model, part->around.constants);
    parts_.push_back(std::move(part));
  }
  if (state.ensemble != nullptr) {
    domains_.emplace(spread_slopes_on(state.lattice, state.model.polycrystal, state.spread_shape()),
                     parameters_);
    state.ensemble->record();
  }
  causes_.assign(parameters_ + load_directions.size(), {});
  constexpr std::array<Cause, 3> load_causes{Cause::field_after, Cause::stress_after, Cause::bend};
  for (const auto& part : parts_) {
    coupled_ = coupled_ || part->around.coupled;
    if (part->around.coupled)
      for (std::size_t k = part->around.field_open ? 0 : 1; k < load_causes.size(); ++k)
        causes_[parameters_ + k][static_cast<std::size_t>(load_causes[k])] = 1;
  }
}

// The value of a knot with the tangents that the drive's directions give it.
ForwardSensitivities::Number ForwardSensitivities::knot(const Part& part, double value,
                                                        std::span<const double> slopes,
                                                        std::size_t index) const {
  Number out(value);
  if (slopes.empty()) return out;
  for (std::size_t p = 0; p < part.count; ++p)
    if (part.first + p >= first_direction_)
      out.tangent[p] = slopes[index * drive_.count + part.first + p - first_direction_];
  return out;
}

void ForwardSensitivities::start(double field, const Fractions& fractions, double time) {
  knot_ = 0;
  in_past_ = time < 0;
  for (auto& part : parts_) {
    auto& around = part->around;
    part->command = in_past_ ? Number(field) : knot(*part, field, drive_.field, 0);
    around.start(part->command, fractions, time);
    part->at = part->at_before = around.loads_at_start();
    part->polarization = part->polarization_before = around.remanent(0);
    part->trial = {};
    part->bend = 0;
    if (part->law) {
      around.means.plus_rate = part->law->slope(part->law->rates(part->at, 1), 1);
      continue;
    }
    for (std::size_t p = 0; p < part->count; ++p) causes_[part->first + p] = causes_of(*part, p);
  }
  if (domains_) {
    domains_->start(state_.ensemble->take_change());
    domains_->step(state_.ensemble->start_proposal(), causes_, means_);
    for (auto& part : parts_) {
      take_means(*part, state_.means);
      part->around.means = part->trial.means;
      for (auto* mean : {&part->around.means.plus_rate, &part->around.means.minus_rate})
        for (const std::size_t k : load_directions) mean->tangent[k] = 0;
    }
  }
  for (auto& part : parts_) part->around.start_sensors();
  stepping_ = false;
}

void ForwardSensitivities::begin_recording() {
  in_past_ = false;
  for (auto& part : parts_) part->around.begin_recording();
}

void ForwardSensitivities::play(const FieldPiece& command, std::size_t pieces) {
  if (!in_past_) ++knot_;
  for (auto& part : parts_) {
    const auto to = in_past_ ? Number(command.to) : knot(*part, command.to, drive_.field, knot_);
    Number duration(command.duration);
    if (!in_past_ && !drive_.time.empty())
      duration.tangent =
          (knot(*part, 0, drive_.time, knot_) - knot(*part, 0, drive_.time, knot_ - 1)).tangent;
    part->pieces = part->around.driven({duration, part->command, to});
    part->command = to;
    if (part->pieces.size() != pieces)
      throw Error(ErrorCode::internal, "the amplifier's pieces are not those of the simulation");
  }
  piece_ = pieces;
}

void ForwardSensitivities::begin_trial(Part& part, const SolvedStep& step, double done) {
  auto& around = part.around;
  const auto& piece = part.pieces[step.piece];
  auto& trial = part.trial;
  trial = {};
  trial.h = step.share * piece.duration;
  trial.h.value = step.trial.h;
  trial.monitor = step.last ? piece.to : piece.from + (piece.to - piece.from) * done;
  trial.monitor.value = step.trial.monitor;
  const auto first_guess = around.guess(trial.h);
  part.polarization = !vanishes(around.ports.fatigue) ? around.remanent(around.dissipated_by(first_guess))
                                                      : around.constants.polarization;
  trial.end = around.material;
  trial.end.field = trial.monitor;
  if (!around.coupled) {
    part.at = around.loads_after(trial, first_guess);
    part.bend = 0;
    return;
  }
  part.at.field = around.field_open ? unknown<Number>(step.at.field, field_direction)
                                    : trial.monitor + around.added_for_rates(trial.h, trial.end);
  part.at.stress = unknown<Number>(step.at.stress, stress_direction);
  part.bend = unknown<Number>(step.bend.stress, bend_direction);
}

Causes ForwardSensitivities::causes_of(const Part& part, std::size_t direction) {
  Causes out{};
  const auto set = [&](Cause cause, double by) { out[static_cast<std::size_t>(cause)] = by; };
  const auto moved = [&](Cause cause, const Number& by) { set(cause, by.tangent[direction]); };
  const auto relative = [&](const Number& v) { return v.value != 0 ? v.tangent[direction] / v.value : 0.0; };
  const auto& k = part.around.constants;
  const auto& p = part.around.model.polycrystal;
  moved(Cause::field_before, part.at_before.field);
  moved(Cause::field_after, part.at.field);
  moved(Cause::stress_before, part.at_before.stress);
  moved(Cause::stress_after, part.at.stress);
  moved(Cause::bend, part.bend);
  moved(Cause::polarization_before, part.polarization_before);
  moved(Cause::polarization_after, part.polarization);
  moved(Cause::strain_90, k.strain_90);
  moved(Cause::piezoelectric, k.piezoelectric);
  moved(Cause::half_permittivity, k.half_permittivity);
  moved(Cause::half_compliance, k.half_compliance);
  moved(Cause::stabilization, k.stress_stabilization);
  moved(Cause::asymmetry, k.barrier_asymmetry);
  set(Cause::log_direct_rate, relative(k.direct_rate));
  moved(Cause::direct_barrier, k.direct_barrier);
  set(Cause::log_energy, relative(k.inverse_energy));
  set(Cause::log_span, relative(part.trial.h) - relative(k.relaxation_time));
  set(Cause::log_barrier, relative(part.around.model.material.barrier));
  moved(Cause::barrier_log_std, p.barrier_log_std);
  moved(Cause::internal_field, p.bias_field);
  moved(Cause::internal_field_std, p.interaction_field_std);
  moved(Cause::internal_stress_std, p.interaction_stress_std);
  moved(Cause::skewness, part.around.ports.spread_skewness);
  moved(Cause::inverse_freedom, part.around.ports.spread_inverse_freedom);
  return out;
}

// The means at the end of the trial from what the domains' step gave.
void ForwardSensitivities::take_means(Part& part, const Means& means) {
  const Number& tau = part.around.constants.relaxation_time;
  const auto number = [&](double value, double MeanTangents::*member) {
    Number out(value);
    for (std::size_t p = 0; p < part.count; ++p) out.tangent[p] = means_[part.first + p].*member;
    for (std::size_t k = 0; k < load_directions.size(); ++k)
      out.tangent[load_directions[k]] = means_[parameters_ + k].*member;
    return out;
  };
  part.trial.means = {number(means.plus, &MeanTangents::plus), number(means.minus, &MeanTangents::minus),
                      number(means.plus_rate * tau.value, &MeanTangents::plus_rate) / tau,
                      number(means.minus_rate * tau.value, &MeanTangents::minus_rate) / tau};
}

// The loads' own tangents, by the implicit function theorem, and with them those of all that has moved with
// the loads.
ForwardSensitivities::LoadTangents ForwardSensitivities::end_trial(Part& part) {
  auto& around = part.around;
  auto& trial = part.trial;
  LoadTangents loads{};
  if (!around.coupled) {
    around.loads_after(trial, trial.means);
  } else {
    trial.end.field = around.across(trial, trial.means, part.at.field);
    trial.end.stress = part.at.stress;
    const auto answer = around.loads_after(trial, trial.means);
    const std::array<Number, 3> residual{answer.field - part.at.field, answer.stress - part.at.stress,
                                         around.bend(trial).stress - part.bend};
    Eigen::Matrix3d slope;
    Eigen::Matrix<double, 3, Eigen::Dynamic> moves(3, static_cast<Eigen::Index>(part.count));
    for (int i = 0; i < 3; ++i) {
      const auto& r = residual[static_cast<std::size_t>(i)];
      for (int k = 0; k < 3; ++k) slope(i, k) = r.tangent[load_directions[static_cast<std::size_t>(k)]];
      for (std::size_t p = 0; p < part.count; ++p) moves(i, static_cast<Eigen::Index>(p)) = r.tangent[p];
    }
    if (!around.field_open) {  // the field is given
      slope(0, 0) = -1;
      moves.row(0).setZero();
    }
    moves = -slope.inverse() * moves;
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t p = 0; p < part.count; ++p)
        loads[k][p] = moves(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(p));
    auto& end = trial.end;
    auto& e = trial.equilibrium;
    auto& m = trial.means;
    for (Number* y :
         {&m.plus, &m.minus, &m.plus_rate, &m.minus_rate, &end.field, &end.stress, &end.plus, &end.minus,
          &end.switched_polarization, &end.instant_strain, &e.stress, &e.displacement, &e.strain, &e.force,
          &trial.resistance_input, &part.at.field, &part.at.stress, &part.bend})
      for (std::size_t k = 0; k < 3; ++k) {
        const double by = std::exchange(y->tangent[load_directions[k]], 0.0);
        for (std::size_t p = 0; p < part.count; ++p) y->tangent[p] += by * loads[k][p];
      }
  }
  trial.dissipation = around.dissipated_by(trial.means);
  return loads;
}

void ForwardSensitivities::solved(const SolvedStep& step) {
  if (step.piece != piece_) {
    piece_ = step.piece;
    done_ = 0;
    for (auto& part : parts_) {
      part->around.turn();
      part->piece_start = part->around.material.time;
    }
  }
  done_ += step.share;
  last_ = step.last;
  for (auto& part : parts_) {
    begin_trial(*part, step, done_);
    if (!part->law) {
      for (std::size_t p = 0; p < part->count; ++p) causes_[part->first + p] = causes_of(*part, p);
      continue;
    }
    const auto& law = *part->law;
    const auto from = law.rates(part->at_before, part->around.means.plus);
    auto plus = unknown<Number>(step.trial.means.plus, implicit_direction);
    const auto moves =
        implicit_tangents(law.miss(part->trial.h, from, part->around.means.plus, part->at, plus));
    Number rate = law.slope(law.rates(part->at, plus), plus);
    eliminate(plus, moves);
    eliminate(rate, moves);
    part->trial.means = {plus, 0, rate, 0};
  }
  std::array<std::vector<double>, 3> loads;
  for (auto& row : loads) row.resize(parameters_);
  if (domains_) {
    domains_->wake(state_.ensemble->take_change().woken);
    domains_->step(state_.ensemble->proposal(), causes_, means_);
  }
  for (auto& part : parts_) {
    if (domains_) take_means(*part, step.trial.means);
    const auto moves = end_trial(*part);
    for (std::size_t k = 0; k < 3; ++k)
      std::copy_n(moves[k].begin(), part->count, loads[k].begin() + static_cast<std::ptrdiff_t>(part->first));
  }
  if (domains_ && coupled_) domains_->settle(loads);
  stepping_ = true;
}

void ForwardSensitivities::put(Part& part, const Sensed<Number>& seen, std::size_t row) {
  const auto write = [&](std::span<double> to, const Number& from) {
    if (!to.empty())
      std::copy_n(from.tangent.begin(), part.count,
                  to.begin() + static_cast<std::ptrdiff_t>(row * parameters_ + part.first));
  };
  write(out_.field, seen.field);
  write(out_.charge, seen.charge);
  write(out_.displacement, seen.displacement);
  write(out_.force, seen.force);
}

void ForwardSensitivities::sense_at(double time, std::size_t row) {
  Sensed<Number> seen;
  for (auto& part : parts_) {
    if (!stepping_) {
      wide::sense(part->around, part->around.now(), 0, seen);
    } else {
      const auto& trial = part->trial;
      const Number since = std::clamp<Number>(time - part->around.material.time, 0, trial.h);
      wide::sense(part->around, trial, since, seen);
    }
    put(*part, seen, first_row_ + row);
  }
}

void ForwardSensitivities::sense_within(double share) {
  Sensed<Number> seen;
  for (auto& part : parts_)
    wide::sense(part->around, part->trial, share < 1 ? share * part->trial.h : part->trial.h, seen);
}

void ForwardSensitivities::accepted() {
  for (auto& part : parts_) {
    part->around.accept(part->trial);
    part->at_before = part->at;
    part->polarization_before = part->polarization;
    if (last_) part->around.material.time = part->piece_start + part->pieces[piece_].duration;
  }
  if (last_) piece_ = parts_.empty() ? 0 : parts_.front()->pieces.size();
  if (domains_) domains_->put_to_sleep(state_.ensemble->take_change().slept);
  stepping_ = false;
}

SimulationStatistics simulate_with_slopes(const Model& model, std::span<const std::string> parameters,
                                          std::span<const double> knot_time,
                                          std::span<const double> knot_field, std::span<const double> times,
                                          const ChannelSpans& out, const SlopeSpans& slopes,
                                          const SimulationOptions& options, const DriveDirections& drive) {
  const std::size_t knots = drive.count * knot_time.size();
  if ((!drive.time.empty() && drive.time.size() != knots) || drive.field.size() != knots)
    throw Error(ErrorCode::invalid_params, "the drive's directions must give each knot an entry",
                Problem{.path = "/drive", .message = "has another length", .given = drive.field.size()});
  Simulator::State state(model, options);
  ForwardSensitivities sensitivities(state, model, parameters, slopes, drive);
  state.observer = &sensitivities;
  play_knots(state, knot_time, knot_field, times, out, [&](std::size_t done) { sensitivities.begin(done); });
  return state.statistics;
}

}  // namespace ferrobench::model
