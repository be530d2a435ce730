#include "tests/campaign/twin.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/campaign/grains.h"
#include "tests/campaign/mechanics.h"
#include "tests/campaign/sensors.h"

namespace ferrobench::campaign {
namespace {

constexpr double boltzmann = 1.380649e-23;

RateLaw rate_law(const model::Material& m, const Terms& t) {
  RateLaw law;
  law.polarization = m.remanent_polarization;
  law.strain_90 = m.remanent_strain_90;
  law.piezoelectric = m.piezoelectric_180;
  law.permittivity_step = m.permittivity_180 - m.permittivity_90;
  law.compliance_step = m.compliance_180 - m.compliance_90;
  law.inverse_energy = m.activation_volume / (boltzmann * m.temperature);
  law.attempt_rate = 1 / m.relaxation_time;
  law.stabilization = t.stabilization;
  law.rising = 1 + t.asymmetry;
  law.falling = 1 - t.asymmetry;
  law.exponent = t.barrier_exponent;
  law.direct_rate = t.direct_rate;
  law.direct_barrier = t.direct_barrier;
  return law;
}

// A root closed in on by secants; g rises.
class Root {
 public:
  explicit Root(double guess) : at_(guess) {}
  double at() const { return at_; }
  void learn(double g, double first_move) {
    (g > 0 ? high_ : low_) = at_;
    double next = at_ + first_move;
    if (tries_++ > 0 && g != last_g_) next = at_ - g * (at_ - last_at_) / (g - last_g_);
    if (!(next > low_ && next < high_)) {
      const double middle = 0.5 * (low_ + high_);
      if (std::isfinite(middle)) next = middle;
    }
    last_at_ = at_;
    last_g_ = g;
    at_ = next;
  }

 private:
  double at_, last_at_ = 0, last_g_ = 0;
  double low_ = -std::numeric_limits<double>::infinity(), high_ = -low_;
  int tries_ = 0;
};

class Player {
 public:
  Player(const model::Model& model, const Terms& terms, const TwinOptions& options)
      : mechanics_(model, terms),
        options_(options),
        law_(rate_law(model.material, terms)),
        grains_(draw_nodes(model.material, model.polycrystal, options.domains, terms)) {}

  const State& state() const { return now_; }
  Seen truth() const {
    const auto& a = mechanics_.model().actuator;
    const double charge =
        static_cast<double>(a.layer_count) * a.area * (mechanics_.polarization(now_) + now_.conducted);
    return {now_.monitor, charge, now_.displacement, mechanics_.force(now_)};
  }

  // At rest under the first command, after the past, which ends at time 0.
  void start(double command) {
    using enum protocols::PastKind;
    const auto& past = options_.past;
    switch (past.kind) {
      case unknown:
      case poled_plus:
        return rest(1, 0, 0, command);
      case poled_minus:
        return rest(0, 1, 0, command);
      case unpoled:
        return rest(1.0 / 3, 1.0 / 3, 0, command);
      case visited:
        return visit(past, command);
      case cycled:
      case partly_poled:
        throw Error(ErrorCode::invalid_params, "the twin plays neither cycles nor what is partly poled");
    }
  }

  // One sample interval: the command goes linearly to `command`; `look` is called after each step.
  template <class Look>
  void interval(double span, double command, Look&& look) {
    const double slope = (command - command_) / span, from = command_, begin = now_.time;
    if (std::abs(slope - slope_) > 1e-9 * (std::abs(slope) + std::abs(slope_))) {
      corner_ = begin;
      stress_slope_ = 0;
    }
    slope_ = slope;
    double done = 0;
    while (done < span) {
      double h = std::min(span - done, longest_step(span, from + slope * done));
      if (span - done - h < 0.3 * h) h = span - done > 1.001 * h ? 0.5 * (span - done) : span - done;
      while (!step(h, from + slope * (done + h), begin + done + h)) {
        h *= 0.5;
        if (h < 1e-12 * span)
          throw Error(ErrorCode::numerical, "the twin does not converge at t = " + std::to_string(now_.time));
      }
      done = h >= span - done ? span : done + h;
      look(now_.time, truth());
    }
    command_ = command;
  }

 private:
  void rest(double plus, double minus, double time, double command) {
    std::ranges::fill(grains_.plus, plus);
    std::ranges::fill(grains_.minus, minus);
    now_ = {};
    now_.plus = plus;
    now_.minus = minus;
    now_.time = corner_ = time;
    now_.stress = -mechanics_.model().load.prestress;
    mechanics_.rest_in(now_);
    command_ = command;
    now_.monitor = now_.field = distorted(command);
    mechanics_.settle(now_, now_, 0);
  }

  // One level after the other, then to the first command as fast as the fastest of them (protocols/past.h).
  void visit(const protocols::Past& past, double command) {
    double slew = 0, from = 0, time = 0;
    for (const auto& level : past.levels) {
      slew = std::max(slew, std::abs(level.field - from) / level.seconds);
      from = level.field;
      time += level.seconds;
    }
    const double back = std::abs(command - from) / slew;
    using enum protocols::FirstState;
    const auto first = past.from.value_or(poled_plus);
    if (first == partly_poled)
      throw Error(ErrorCode::invalid_params, "the twin plays nothing that was partly poled");
    rest(first == poled_plus ? 1
         : first == unpoled  ? 1.0 / 3
                             : 0,
         first == poled_minus ? 1
         : first == unpoled   ? 1.0 / 3
                              : 0,
         -time - back, 0);
    // In pieces, as between samples.
    const auto ramp = [&](double to, double seconds) {
      constexpr int pieces = 100;
      for (int i = 1, n = seconds > 0 ? pieces : 0; i <= n; ++i)
        interval(seconds / pieces, command_ + (to - command_) / (pieces + 1 - i), [](double, const Seen&) {});
    };
    for (const auto& level : past.levels) ramp(level.field, level.seconds);
    ramp(command, back);
    now_.time = corner_ = now_.conducted = 0;
  }

  double distorted(double e) const {
    const auto& t = mechanics_.terms();
    const double width = t.crossover_width;
    return e - t.crossover_depth * std::tanh(e / width) * std::exp(-std::pow(e / (4 * width), 2));
  }

  // Change of ln(rate) per field and per stress.
  double per_field() const {
    const auto& m = mechanics_.model().material;
    const double charges = law_.direct_rate > 0 ? 2 : 1;  // that a direct switch moves, over those of 90
    return charges * law_.inverse_energy *
           (m.remanent_polarization + std::abs(m.piezoelectric_180 * now_.stress));
  }
  double per_stress() const {
    const auto& m = mechanics_.model().material;
    return law_.inverse_energy *
           (std::abs(m.remanent_strain_90) + std::abs(m.piezoelectric_180 * now_.field));
  }

  double longest_step(double span, double command) const {
    double h = std::max(0.02 * span, 0.25 * (now_.time - corner_));
    const auto& rate = mechanics_.terms().slew_rate;
    const bool behind = rate && std::abs(command - now_.monitor) > 1e-9 * std::abs(command);
    const double speed = behind ? *rate : std::abs(slope_);
    if (speed > 0) h = std::min(h, options_.path / (per_field() * speed));
    const double ringing = per_stress() * std::abs(now_.stress - now_.settled_stress);
    if (mechanics_.period() > 0 && ringing > 0.1)
      h = std::min(h, mechanics_.period() / std::max(16.0, 8 * ringing));
    return h;
  }

  double driven(double h, double command) const {
    const auto& t = mechanics_.terms();
    if (t.amplifier_lag > 0) return low_pass(now_.monitor, command - slope_ * h, command, h, t.amplifier_lag);
    if (t.slew_rate)
      return now_.monitor + std::clamp(command - now_.monitor, -*t.slew_rate * h, *t.slew_rate * h);
    return distorted(command);
  }

  // Across the material, behind the source resistance: what P does besides its permittivity slows E like an
  // input, the permittivity makes the lag.
  double behind_resistance(const State& to, double h) const {
    const double r = mechanics_.terms().source_resistance;
    const double kappa = mechanics_.model().material.permittivity_180;
    const double rest =
        mechanics_.polarization(to) - kappa * to.field - mechanics_.polarization(now_) + kappa * now_.field;
    const double current = r * rest / h;
    return low_pass(now_.field, now_.monitor - current, to.monitor - current, h, r * kappa);
  }

  bool step(double h, double command, double time) {
    const auto& t = mechanics_.terms();
    State to = now_;
    to.time = time;
    to.monitor = driven(h, command);
    law_.polarization = mechanics_.remanent(now_);
    law_.attempt_rate = std::exp(t.warming * (options_.session_time + now_.time + 0.5 * h)) /
                        mechanics_.model().material.relaxation_time;
    const bool resisted = t.source_resistance > 0, dragged = t.drag > 0;
    Root field(resisted ? now_.field + (to.monitor - now_.monitor) : dragged ? drag_ : 0);
    double stress = now_.stress + stress_slope_ * h;
    const double ringing = mechanics_.period();
    const bool fast_ringing = ringing > 0 && h > ringing / 8;
    if (fast_ringing) stress = now_.settled_stress + stress_slope_ * h;
    const double first_stress = fast_ringing ? now_.settled_stress : now_.stress;
    const double per_order = t.mean_field * mechanics_.model().material.remanent_polarization;
    double order = now_.order();
    constexpr double early = 0.21132486540518713, late = 1 - early;
    for (int i = 0; i < 25; ++i) {
      const double e1 = resisted ? field.at() : to.monitor, drag = dragged ? field.at() : 0;
      const auto at = [&](double u) {
        const double mean_field = per_order * (now_.order() + (order - now_.order()) * u);
        return LoadPoint{now_.field + (e1 - now_.field) * u + drag + mean_field,
                         first_stress + (stress - first_stress) * u};
      };
      const auto mean = advance(law_, grains_, h, at(early), at(late));
      to.plus = mean.plus;
      to.minus = mean.minus;
      to.field = e1;
      mechanics_.settle(now_, to, h);
      const double reached = fast_ringing ? to.settled_stress : to.stress;
      const double stress_miss = per_stress() * std::abs(reached - stress);
      double field_miss = per_field() * std::abs(per_order * (to.order() - order));
      order = to.order();
      if (resisted || dragged) {
        const double g = resisted ? e1 - behind_resistance(to, h)
                                  : drag + t.drag * law_.polarization * (to.order() - now_.order()) / h;
        const double miss = per_field() * std::abs(g);
        field_miss = std::max(field_miss, miss);
        if (miss > 0.005) field.learn(g, -g * (resisted ? 0.5 : 0.2));
      }
      if (stress_miss < 0.01 && field_miss <= 0.005) {
        if (per_stress() * std::abs(reached - first_stress) > 1 && h > 1e-9) return false;
        accept(h, to, reached - first_stress, drag);
        return true;
      }
      stress = reached;
    }
    return false;
  }

  void accept(double h, const State& to, double stress_change, double drag) {
    std::swap(grains_.plus, grains_.next_plus);
    std::swap(grains_.minus, grains_.next_minus);
    stress_slope_ = stress_change / h;
    drag_ = drag;
    now_ = to;
  }

  Mechanics mechanics_;
  TwinOptions options_;
  RateLaw law_;
  Grains grains_;
  State now_;
  double command_ = 0, slope_ = 0, corner_ = 0, stress_slope_ = 0, drag_ = 0;
};

}  // namespace

Response play(const model::Model& given, const std::vector<model::EffectSetting>& effects,
              const std::vector<double>& time, const std::vector<double>& command,
              const TwinOptions& options) {
  auto model = given;
  auto all = model.effects;
  all.insert(all.end(), effects.begin(), effects.end());
  const auto terms = make_terms(all, model);
  if (model.material.barrier_law != model::BarrierLaw::equal_curvature ||
      model.polycrystal.method == model::PolycrystalMethod::parametrized)
    throw Error(ErrorCode::bad_model,
                "the twin knows the equal-curvature barrier and no parametrized polycrystal");
  Player player(model, terms, options);
  Sensors sensors(terms, model.load.prestress * model.actuator.area);
  Response out;
  const auto put = [&](const Seen& seen) {
    out.field.push_back(seen.field);
    out.charge.push_back(seen.charge);
    out.displacement.push_back(seen.displacement);
    out.force.push_back(seen.force);
  };
  player.start(command.front());
  put(sensors.look(0, player.truth()));
  for (std::size_t i = 1; i < time.size(); ++i) {
    Seen seen;
    player.interval(time[i] - time[i - 1], command[i],
                    [&](double t, const Seen& truth) { seen = sensors.look(t, truth); });
    put(seen);
  }
  return out;
}

}  // namespace ferrobench::campaign
