#include <algorithm>
#include <cmath>

#include "model/past.h"
#include "model/physics/parametrized.h"
#include "model/simulator_state.h"

namespace ferrobench::model {
namespace {

// The step controller looks at how far the fractions' means are from the trapezoidal rule over their own
// rates. That is about this many times the error that the step leaves behind; held to by tests.
constexpr double error_per_defect = 0.2;

// Where a well ends (F = 4 dg0) ln(rate) stops being a parabola, and the step that goes across takes it as
// straight. A domain that is still in its well then switches late by up to this share of the step, which the
// trapezoidal rule over means does not see.
constexpr double late_at_the_end = 1.0 / 24;

// Where the field that the fractions add moves as far as the one that is applied, or farther, switching runs
// away and what a step is off grows. The largest growth is not known beforehand; with this one the error of
// 18 loops in mean fields of 0.5 to 3e6 V m/C is the tolerance in the (geometric) mean, 30 times that where a
// loop is all but vertical. Without it they are 7 and 230 times, with 20 half as much in 1.2 times the steps.
constexpr double growth_in_feedback = 10;
// In a hold the applied field does not move, and any feedback would count in full. A feedback that moves
// ln(rate) by less than this counts by its share of it.
constexpr double least_way_of_rates = 0.1;

// After so many rejections in a row a step is a few thousandths of what was tried first, so that it is not
// its length that keeps the loads from being found.
constexpr int rejections_until_stuck = 6;

// A plan is followed with the loads solved down to rounding: a difference of two such runs is to show slopes,
// not the coupling's tolerance.
constexpr Coupling::Accuracy tight{.exact = 1e-14, .good_enough = 1e-6, .evaluations = 40};

void put(const Sensed<double>& seen, std::size_t row, const ChannelSpans& out) {
  const auto write = [row](std::span<double> column, double value) {
    if (!column.empty()) column[row] = value;
  };
  write(out.field, seen.field);
  write(out.charge, seen.charge);
  write(out.displacement, seen.displacement);
  write(out.force, seen.force);
  write(out.polarization, seen.polarization);
  write(out.stress, seen.stress);
  write(out.strain, seen.strain);
  write(out.fraction_plus, seen.fraction_plus);
  write(out.fraction_minus, seen.fraction_minus);
}

}  // namespace

Simulator::State::State(Model given, const SimulationOptions& given_options, const StepPlan* plan)
    : Surroundings<double>(std::move(given)), options(given_options), followed(plan) {
  if (options.begun != nullptr) ++*options.begun;
  if (followed != nullptr) mechanics->solve_tightly();
  if (model.polycrystal.method == PolycrystalMethod::parametrized) {
    kinetics = std::make_unique<Parametrized>(model, constants);
    return;
  }
  if (plan == nullptr) {
    const int count = options.domains > 0 ? options.domains
                                          : domains_for(model.material, model.polycrystal, options.tolerance);
    lattice = make_lattice(model.material, model.polycrystal, count, options.shift, options.every_spread);
  } else {
    lattice = plan->lattice;
  }
  auto made =
      std::make_unique<Ensemble>(domains_on(lattice, model.material, model.polycrystal, spread_shape()),
                                 constants, 0.1 * options.tolerance);
  ensemble = made.get();
  kinetics = std::move(made);
  if (plan != nullptr) ensemble->follow();
}

SpreadShape Simulator::State::spread_shape() const {
  return {.skewness = ports.spread_skewness, .inverse_freedom = ports.spread_inverse_freedom};
}

void Simulator::State::start(double field, const Fractions& fractions, double time) {
  command = field;
  next_step = 0;
  cycles = 0;
  statistics = {};
  squared_error = 0;
  planned = 0;
  Surroundings::start(field, fractions, time);
  kinetics->set_polarization(remanent(0));
  kinetics->start(loads_at_start(), fractions);
  if (followed != nullptr && ensemble != nullptr) ensemble->put_to_sleep(followed->start.slept);
  means = kinetics->means();
  coupling.reset();
  start_sensors();
  begin_to_look_on();
  if (observer != nullptr) observer->start(field, fractions, time);
}

void Simulator::State::begin_recording() {
  Surroundings::begin_recording();
  begin_to_look_on();
  // Steps and their error are those of the recording, but for how many were tried.
  statistics.steps = 0;
  squared_error = 0;
  if (observer != nullptr) observer->begin_recording();
}

// Path of ln(rate) per second at most, for a field that changes at `slew`.
double Simulator::State::path_rate(double slew) const {
  return constants.inverse_energy *
         (constants.polarization + std::abs(constants.piezoelectric * material.stress)) * std::abs(slew);
}

// Solves the step's end: the loads that the kinetics see must be those that the fractions bring about.
bool Simulator::State::solve(Trial<double>& trial, bool stuck) {
  const auto first_guess = guess(trial.h);
  if (!vanishes(ports.fatigue)) kinetics->set_polarization(remanent(dissipated_by(first_guess)));
  trial.end = material;
  trial.end.field = trial.monitor;
  at = loads_after(trial, first_guess);
  bent = {};
  if (!coupled) {
    trial.means = kinetics->propose(trial.h, at, bent);
    loads_after(trial, trial.means);
    return true;
  }
  trial.means = first_guess;
  // Behind drag or resistance the loads follow from rates, which mean fractions that hardly move do not
  // bound.
  Coupling::Accuracy usual{.tolerance = 0.05 * options.tolerance,
                           .agreement = by_rates ? 1e-3 : std::numeric_limits<double>::infinity()};
  // They may be many kT away, above all at the start, where domains that a prestress drives set out without
  // drag; one evaluation leads about one kT nearer, and a shorter step does not make the way shorter.
  if (stuck) usual.evaluations = 200;
  return coupling.solve(
      at, {field_scale(), stress_scale()}, followed == nullptr ? usual : tight, [&](const Loads& loads) {
        at = loads;
        bent = bend(trial);
        trial.means = kinetics->propose(trial.h, at, bent);
        trial.end.field = across(trial, trial.means, at.field);
        trial.end.stress = at.stress;
        return Coupling::Answer{loads_after(trial, trial.means), trial.means.plus, trial.means.minus};
      });
}

double Simulator::State::defect(const Trial<double>& trial) const {
  const auto& m = trial.means;
  const double plus = m.plus - means.plus - 0.5 * trial.h * (means.plus_rate + m.plus_rate);
  const double minus = m.minus - means.minus - 0.5 * trial.h * (means.minus_rate + m.minus_rate);
  return std::max({std::abs(plus), std::abs(minus), std::abs(plus + minus)});
}

// The ends of wells as a piece of field passes them. With ln(rate) = -c^2 t^2 / 2 before the end at t = 0,
// the share exp(-sqrt(pi / 2) / (c tau)) of the domains is still there: next to none where tau is short.
Simulator::State::WellEnds Simulator::State::well_ends(double path) const {
  if (path == 0) return {};
  const double c = path / std::sqrt(8 * constants.inverse_energy * model.material.barrier);
  return {c, std::exp(-1.25 / (c * constants.relaxation_time))};
}

// By how much what a step is off grows until the switching is through, where the field that the rates see
// follows the polarization and drives it on.
double Simulator::State::growth(const Trial<double>& trial) const {
  if (ports.seen_by_rates.empty()) return 1;
  const double added = added_for_rates(trial.h, trial.end) - added_for_rates(0, material);
  const auto order = [](const MeansOf<double>& m) { return m.plus - m.minus; };
  if (added * (order(trial.means) - order(means)) <= 0) return 1;
  const double driven = std::abs(trial.monitor - monitor) + least_way_of_rates * field_scale();
  return 1 + growth_in_feedback * std::min(1.0, std::abs(added) / driven);
}

// What the trial leaves behind of the fractions' means, as an estimate.
double Simulator::State::step_error(const Trial<double>& trial, const WellEnds& ends) const {
  const double plus = trial.means.plus - means.plus, minus = trial.means.minus - means.minus;
  const double switched = std::max({std::abs(plus), std::abs(minus), std::abs(plus + minus)});
  const double late = late_at_the_end * ends.reached * std::min(1.0, trial.h * ends.sharpness);
  return growth(trial) * std::max(error_per_defect * defect(trial), late * switched);
}

void Simulator::State::accept_step(Trial<double>& trial, const std::vector<std::size_t>* slept) {
  kinetics->accept();
  if (slept != nullptr && ensemble != nullptr) ensemble->put_to_sleep(*slept);
  accept(trial);
  if (observer != nullptr) observer->accepted();
  ++statistics.steps;
  statistics.domain_steps = kinetics->domain_steps();
  statistics.time_error = std::sqrt(squared_error / std::max(1e-300, material.time));
}

void Simulator::State::begin_to_look_on() {
  for (auto& onlooker : onlookers) begin_to_sense(onlooker.ports, there(now(), 0));
}

void Simulator::State::output(const Trial<double>& trial, double since, std::size_t row,
                              const ChannelSpans* out) {
  const auto unseen = there(trial, since);
  const auto look = [&](Ports& through, const ChannelSpans& to, std::size_t at_row) {
    auto seen = unseen;
    pass_sensors(through, seen);
    if (out != nullptr) put(seen, at_row, to);
  };
  look(ports, out != nullptr ? *out : ChannelSpans{}, row);
  for (auto& onlooker : onlookers) look(onlooker.ports, onlooker.out, first_row + row);
}

void Simulator::State::sense_step(const Trial<double>& trial, std::span<const double> times,
                                  const ChannelSpans& out, double piece_end) {
  const double end = material.time + trial.h;
  // The last time of a piece may miss its end by rounding.
  const double slack = 1e-12 * std::max(1.0, std::abs(piece_end));
  // Sensors take what they see as linear from one time to the next, which a whole step of switching is not.
  const bool sensors = has_sensors() || std::ranges::any_of(onlookers, [](const Onlooker& onlooker) {
                         return senses(onlooker.ports);
                       });
  constexpr int parts = 4;
  int part = 1;
  const auto look = [&](double since) {
    output(trial, since, 0, nullptr);
    if (observer != nullptr) observer->sense_within(since / trial.h);
  };
  const auto watch = [&](double until) {
    for (; sensors && part < parts && material.time + part * trial.h / parts < until - slack; ++part)
      look(part * trial.h / parts);
  };
  while (sensed < times.size() && times[sensed] <= end + slack) {
    watch(times[sensed]);
    output(trial, std::clamp(times[sensed] - material.time, 0.0, trial.h), sensed, &out);
    if (observer != nullptr) observer->sense_at(times[sensed], sensed);
    ++sensed;
  }
  watch(end);
  if (sensors && (sensed == 0 || times.empty() || times[sensed - 1] < end - slack)) look(trial.h);
}

// Takes a solved step: what is seen in it, then its end as the new state.
void Simulator::State::take(Trial<double>& trial, const SolvedStep& step, std::span<const double> times,
                            const ChannelSpans& out, double piece_end) {
  trial.dissipation = dissipated_by(trial.means);
  if (observer != nullptr) observer->solved(step);
  sense_step(trial, times, out, piece_end);
  accept_step(trial, followed == nullptr ? nullptr : &followed->steps[planned - 1].change.slept);
}

void Simulator::State::play_piece(const FieldPiece& piece, std::size_t index, std::span<const double> times,
                                  const ChannelSpans& out) {
  const double start_time = material.time, piece_end = start_time + piece.duration;
  const double slew = (piece.to - piece.from) / piece.duration;
  const double path = path_rate(slew);
  const WellEnds ends = well_ends(path);
  double step = next_step > 0 ? next_step : constants.relaxation_time;
  if (path > 0) step = std::min(step, 20 / path);
  double done = 0;
  turn();
  int rejections = 0;
  while (done < piece.duration) {
    const double remaining = piece.duration - done;
    double h = std::min(step, mechanics->largest_step(slew, options.tolerance));
    const bool last = h > 0.8 * remaining;
    if (last && h < remaining) h = h > remaining / 1.2 ? remaining : remaining / 2;
    if (h >= remaining) h = remaining;
    check_stop(options);
    if (options.most_steps > 0 && statistics.tried >= options.most_steps)
      throw Error(ErrorCode::numerical, "the model wants more than " + std::to_string(options.most_steps) +
                                            " steps by t = " + std::to_string(material.time) + " s");
    ++statistics.tried;
    Trial<double> trial;
    trial.h = h;
    trial.monitor = h == remaining ? piece.to : piece.from + slew * (done + h);
    const bool solved = solve(trial, rejections > rejections_until_stuck);
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
    squared_error += error * error * h;
    take(trial, {trial, at, bent, h / piece.duration, h == remaining, index}, times, out, piece_end);
    done = h == remaining ? piece.duration : done + h;
    const double grown = h * std::min(2.5, 0.9 * std::cbrt(1 / std::max(ratio, 1e-3)));
    step = h == remaining ? std::max(step, grown) : grown;
  }
  material.time = piece_end;
  next_step = step;
}

// The same with the steps of a plan.
void Simulator::State::follow_piece(const FieldPiece& piece, std::size_t index, std::span<const double> times,
                                    const ChannelSpans& out) {
  const double piece_end = material.time + piece.duration;
  double done = 0;  // share of the piece
  turn();
  for (bool last = false; !last;) {
    if (planned == followed->steps.size())
      throw Error(ErrorCode::numerical,
                  "the plan ends before the run, at t = " + std::to_string(material.time) + " s");
    const auto& step = followed->steps[planned++];
    last = step.last;
    Trial<double> trial;
    trial.h = step.share * piece.duration;
    done += step.share;
    trial.monitor = last ? piece.to : piece.from + (piece.to - piece.from) * done;
    if (ensemble != nullptr) ensemble->wake(step.change.woken);
    if (!solve(trial))
      throw Error(ErrorCode::numerical,
                  "the planned step does not converge at t = " + std::to_string(material.time) + " s");
    take(trial, {trial, at, bent, step.share, last, index}, times, out, piece_end);
  }
  material.time = piece_end;
}

void Simulator::State::play(double duration, double field, std::span<const double> times,
                            const ChannelSpans& out) {
  sensed = 0;
  while (sensed < times.size() && times[sensed] <= material.time) {
    output(now(), 0, sensed, &out);
    if (observer != nullptr) observer->sense_at(times[sensed], sensed);
    ++sensed;
  }
  if (duration <= 0) return;
  const FieldPiece whole{duration, command, field};
  const auto pieces = driven(whole);
  if (observer != nullptr) observer->play(whole, pieces.size());
  for (std::size_t i = 0; i < pieces.size(); ++i)
    followed == nullptr ? play_piece(pieces[i], i, times, out) : follow_piece(pieces[i], i, times, out);
  command = field;
}

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
  start_after(*state_, field);
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
  state_->play(duration, field, times, out);
}

}  // namespace ferrobench::model
