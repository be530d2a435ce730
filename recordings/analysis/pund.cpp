#include "recordings/analysis/pund.h"

#include <algorithm>
#include <cmath>

#include "recordings/analysis/signals.h"
#include "recordings/analysis/statistics.h"

namespace ferrobench::recordings {
namespace {

constexpr double pulse_from = 0.05, pulse_rest = 0.01;  // shares of the largest field

double largest_of(const std::vector<double>& values) {
  double largest = 0;
  for (const double v : values) largest = std::max(largest, std::abs(v));
  return largest;
}

// Testers measure pulse by pulse, with nothing between.
double longest_step(const std::vector<double>& time) {
  constexpr double usual_steps = 5;
  std::vector<double> steps;
  for (std::size_t i = 1; i < time.size(); ++i) steps.push_back(time[i] - time[i - 1]);
  return usual_steps * median(std::move(steps));
}

std::optional<double> mean_of(std::optional<double> a, std::optional<double> b) {
  if (a && b) return (*a + *b) / 2;
  return a ? a : b;
}

const std::optional<double>& of(const std::array<std::optional<double>, 4>& change, PulseKind kind) {
  return change.at(static_cast<std::size_t>(kind));
}

}  // namespace

std::vector<Pulse> find_pulses(const Recording& r) {
  const auto& field = r.at(Channel::field);
  const double largest = largest_of(field), step = longest_step(r.time);
  std::vector<Pulse> out;
  for (std::size_t i = 1; i < field.size(); ++i) {
    if (!(std::abs(field[i]) > pulse_from * largest) || std::abs(field[i - 1]) > pulse_from * largest)
      continue;
    Pulse pulse{i - 1, i, i, field[i] > 0};
    const double sign = pulse.up ? 1 : -1;
    while (pulse.start > 0 && sign * field[pulse.start] > 0 &&
           sign * field[pulse.start - 1] < sign * field[pulse.start] &&
           r.time[pulse.start] - r.time[pulse.start - 1] <= step)
      --pulse.start;
    const auto within = [&](double limit) {
      return pulse.end + 1 < field.size() && (field[pulse.end] > 0) == pulse.up &&
             std::abs(field[pulse.end]) > limit * largest;
    };
    for (; within(pulse_from); ++pulse.end)
      if (std::abs(field[pulse.end]) > std::abs(field[pulse.peak])) pulse.peak = pulse.end;
    i = pulse.end;
    while (within(pulse_rest)) ++pulse.end;
    while (within(0) && sign * field[pulse.end + 1] < sign * field[pulse.end] &&
           r.time[pulse.end + 1] - r.time[pulse.end] <= step)
      ++pulse.end;
    if (pulse.end - pulse.start > 4) out.push_back(pulse);
  }
  return out;
}

bool is_pund(const Recording& r, const std::vector<Pulse>& pulses) {
  constexpr std::size_t least = 4, most = 64;
  constexpr double alike = 0.5;
  const auto& field = r.at(Channel::field);
  if (pulses.size() < least || pulses.size() > most) return false;
  double largest = 0;
  for (const auto& p : pulses) largest = std::max(largest, std::abs(field[p.peak]));
  bool up = false, down = false;
  for (std::size_t i = 0; i < pulses.size(); ++i) {
    if (std::abs(field[pulses[i].peak]) < alike * largest) return false;
    if (i == 0 || pulses[i].up != pulses[i - 1].up) continue;
    (pulses[i].up ? up : down) = true;
  }
  return up && down;
}

std::optional<PulseSequence> pulse_sequence(const Recording& r) {
  if (r.size() < 2 || !r.has(Channel::field) || !r.has(Channel::charge)) return std::nullopt;
  PulseSequence out{.list = find_pulses(r), .polarization = {}};
  if (!is_pund(r, out.list)) return std::nullopt;
  const auto p = polarization(r);
  out.polarization.assign(p.values.begin(), p.values.end());
  return out;
}

std::vector<PundCycle> pund_cycles(const std::vector<Pulse>& pulses) {
  std::vector<PundCycle> out;
  PundCycle cycle;
  const auto close = [&] {
    if (std::ranges::any_of(cycle, [](const auto& pulse) { return pulse.has_value(); }))
      out.push_back(std::exchange(cycle, {}));
  };
  for (std::size_t i = 1; i < pulses.size(); ++i) {
    const bool switches = pulses[i].up != pulses[i - 1].up;
    const auto kind =
        pulses[i].up ? (switches ? PulseKind::p : PulseKind::u) : (switches ? PulseKind::n : PulseKind::d);
    auto& place = cycle.at(static_cast<std::size_t>(kind));
    if (place) close();
    cycle.at(static_cast<std::size_t>(kind)) = i;
  }
  close();
  return out;
}

std::optional<double> PundCharges::switched() const {
  const auto pair = [&](PulseKind switching, PulseKind not_switching) -> std::optional<double> {
    const auto &a = of(change, switching), &b = of(change, not_switching);
    return a && b ? std::optional(std::abs(*a) - std::abs(*b)) : std::nullopt;
  };
  return mean_of(pair(PulseKind::p, PulseKind::u), pair(PulseKind::n, PulseKind::d));
}

std::optional<double> PundCharges::non_switched() const {
  const auto size = [&](PulseKind kind) {
    const auto& value = of(change, kind);
    return value ? std::optional(std::abs(*value)) : std::nullopt;
  };
  return mean_of(size(PulseKind::u), size(PulseKind::d));
}

PundCharges charges_of(const PundCycle& cycle, const std::vector<Pulse>& pulses,
                       const std::vector<double>& polarization, std::size_t Pulse::*at) {
  PundCharges out;
  for (std::size_t k = 0; k < cycle.size(); ++k)
    if (cycle[k]) {
      const auto& pulse = pulses[*cycle[k]];
      out.change[k] = polarization[pulse.*at] - polarization[pulse.start];
    }
  return out;
}

std::optional<TesterFigures> tester_figures(const PundCycle& cycle, const std::vector<Pulse>& pulses,
                                            const std::vector<double>& polarization) {
  if (std::ranges::any_of(cycle, [](const auto& pulse) { return !pulse.has_value(); })) return std::nullopt;
  const auto pulse = [&](PulseKind kind) { return pulses[*cycle.at(static_cast<std::size_t>(kind))]; };
  const double high = polarization[pulse(PulseKind::p).peak], deep = polarization[pulse(PulseKind::n).peak];
  const double middle = (high + deep) / 2;
  return TesterFigures{.p_max = high - middle,
                       .relaxed_plus = polarization[pulse(PulseKind::u).start] - middle,
                       .relaxed_minus = polarization[pulse(PulseKind::d).start] - middle};
}

}  // namespace ferrobench::recordings
