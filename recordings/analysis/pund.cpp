#include "recordings/analysis/pund.h"

#include <algorithm>
#include <cmath>
#include <span>

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

std::optional<Reading> mean_of(const std::optional<Reading>& a, const std::optional<Reading>& b) {
  if (a && b) return 0.5 * (*a + *b);
  return a ? a : b;
}

const std::optional<Reading>& of(const std::array<std::optional<Reading>, 4>& change, PulseKind kind) {
  return change.at(static_cast<std::size_t>(kind));
}

// The field of pulses, what noise does to it taken into account.
class PulseField {
 public:
  explicit PulseField(const Recording& r)
      : field_(r.at(Channel::field)),
        time_(r.time),
        largest_(largest_of(field_)),
        step_(longest_step(r.time)),
        noise_(r.noise.at(static_cast<std::size_t>(Channel::field)).value_or(estimate_noise(field_))) {}

  bool within(std::size_t i, double share) const { return std::abs(field_[i]) > share * largest_; }

  // The last sample that noise cannot tell from the largest, where the field stays there; the middle of them
  // where it only passes.
  std::size_t peak(std::size_t largest, std::size_t first, std::size_t last) const {
    constexpr double widest = 10;  // standard deviations from the highest of a million samples to the lowest
    const double top = std::abs(field_[largest]) - widest * noise_;
    std::size_t from = largest, to = largest;
    while (from > first && std::abs(field_[from - 1]) >= top) --from;
    while (to < last && std::abs(field_[to + 1]) >= top) ++to;
    const std::size_t count = to - from + 1, quarter = count / 4;
    if (quarter == 0) return noise_ > 0 ? largest : to;
    const std::span all(field_);
    const double inside = std::abs(mean(all.subspan(from + quarter, count - 2 * quarter))),
                 end = std::abs(mean(all.subspan(to + 1 - quarter, quarter)));
    constexpr double falls = 1.5;  // of a triangle's top, an end lies three standard deviations below
    return inside - end > falls * noise_ ? from + count / 2 : to;
  }

  // The sample at which a field of this sign has come to rest, seen from sample `at` on, before or after it:
  // noise hides what is left, or nothing lower follows at once.
  std::size_t rest(std::size_t at, double sign, bool before) const {
    constexpr double hidden = 3;
    constexpr std::size_t follows = 8;
    const double none = std::max(hidden * noise_, 1e-9 * largest_);
    const auto beside = [before](std::size_t i) { return before ? i - 1 : i + 1; };
    const auto ends = [&](std::size_t i) {
      return (before ? i == 0 : i + 1 == field_.size()) || std::abs(time_[beside(i)] - time_[i]) > step_;
    };
    const auto falls_from = [&](std::size_t i) {
      const double here = sign * field_[i];
      for (std::size_t k = 0; k < follows && !ends(i); ++k)
        if (i = beside(i); sign * field_[i] < here) return true;
      return false;
    };
    while (sign * field_[at] > none && falls_from(at)) at = beside(at);
    return at;
  }

 private:
  const std::vector<double>&field_, &time_;
  double largest_, step_, noise_;
};

}  // namespace

std::vector<Pulse> find_pulses(const Recording& r) {
  const auto& field = r.at(Channel::field);
  const PulseField pulses(r);
  std::vector<Pulse> out;
  for (std::size_t i = 1; i < field.size(); ++i) {
    if (!pulses.within(i, pulse_from) || pulses.within(i - 1, pulse_from)) continue;
    Pulse pulse{i - 1, i, i, field[i] > 0};
    const double sign = pulse.up ? 1 : -1;
    pulse.start = pulses.rest(pulse.start, sign, true);
    const auto goes_on = [&](double share) {
      return pulse.end + 1 < field.size() && (field[pulse.end] > 0) == pulse.up &&
             pulses.within(pulse.end, share);
    };
    for (; goes_on(pulse_from); ++pulse.end)
      if (std::abs(field[pulse.end]) > std::abs(field[pulse.peak])) pulse.peak = pulse.end;
    pulse.peak = pulses.peak(pulse.peak, i, pulse.end);
    i = pulse.end;
    while (goes_on(pulse_rest)) ++pulse.end;
    pulse.end = pulses.rest(pulse.end, sign, false);
    if (pulse.end - pulse.start > 4) out.push_back(pulse);
  }
  return out;
}

bool is_pund(const Recording& r, const std::vector<Pulse>& pulses) {
  constexpr std::size_t least = 4, most = 64;
  constexpr double least_height = 0.5;
  const auto& field = r.at(Channel::field);
  if (pulses.size() < least || pulses.size() > most) return false;
  double largest = 0;
  for (const auto& p : pulses) largest = std::max(largest, std::abs(field[p.peak]));
  bool up = false, down = false;
  for (std::size_t i = 0; i < pulses.size(); ++i) {
    if (std::abs(field[pulses[i].peak]) < least_height * largest) return false;
    if (i == 0 || pulses[i].up != pulses[i - 1].up) continue;
    (pulses[i].up ? up : down) = true;
  }
  return up && down;
}

std::optional<PulseSequence> pulse_sequence(const Recording& r) {
  if (r.size() < 2 || !r.has(Channel::field) || !r.has(Channel::charge)) return std::nullopt;
  auto pulses = find_pulses(r);
  if (!is_pund(r, pulses)) return std::nullopt;
  return PulseSequence{std::move(pulses), polarization(r)};
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

std::optional<Reading> PundCharges::switched() const {
  const auto pair = [&](PulseKind switching, PulseKind not_switching) -> std::optional<Reading> {
    const auto &a = of(change, switching), &b = of(change, not_switching);
    return a && b ? std::optional(abs(*a) - abs(*b)) : std::nullopt;
  };
  return mean_of(pair(PulseKind::p, PulseKind::u), pair(PulseKind::n, PulseKind::d));
}

std::optional<Reading> PundCharges::non_switched() const {
  const auto size = [&](PulseKind kind) {
    const auto& value = of(change, kind);
    return value ? std::optional(abs(*value)) : std::nullopt;
  };
  return mean_of(size(PulseKind::u), size(PulseKind::d));
}

PundCharges charges_of(const PundCycle& cycle, const PulseSequence& pulses, std::size_t Pulse::*at) {
  PundCharges out;
  const auto& p = pulses.polarization;
  for (std::size_t k = 0; k < cycle.size(); ++k)
    if (cycle[k]) {
      const auto& pulse = pulses.list[*cycle[k]];
      out.change[k] = p.reading(pulse.*at) - p.reading(pulse.start);
    }
  return out;
}

std::optional<TesterFigures> tester_figures(const PundCycle& cycle, const PulseSequence& pulses) {
  if (std::ranges::any_of(cycle, [](const auto& pulse) { return !pulse.has_value(); })) return std::nullopt;
  const auto at = [&](PulseKind kind, std::size_t Pulse::*where) {
    return pulses.polarization.reading(pulses.list[*cycle.at(static_cast<std::size_t>(kind))].*where);
  };
  const auto high = at(PulseKind::p, &Pulse::peak);
  const auto middle = 0.5 * (high + at(PulseKind::n, &Pulse::peak));
  return TesterFigures{.p_max = high - middle,
                       .relaxed_plus = at(PulseKind::u, &Pulse::start) - middle,
                       .relaxed_minus = at(PulseKind::d, &Pulse::start) - middle};
}

}  // namespace ferrobench::recordings
