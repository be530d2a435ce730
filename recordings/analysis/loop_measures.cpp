#include "recordings/analysis/loop_measures.h"

#include <cmath>

#include "recordings/analysis/loops.h"

namespace ferrobench::recordings {
namespace {

std::span<const double> part(const Signal& signal, std::size_t first, std::size_t last) {
  return signal.values.empty() ? signal.values : signal.values.subspan(first, last - first + 1);
}

bool any_known(std::span<const double> values) {
  return std::ranges::any_of(values, [](double v) { return !std::isnan(v); });
}

std::optional<double> span_of(std::span<const double> values) {
  const auto range = extremes(values);
  return range ? std::optional(range->span()) : std::nullopt;
}

}  // namespace

LoopMeter::LoopMeter(const Recording& recording, const Turns& turns) {
  const auto take = [&](Signal measured) {
    smoothed_any_ = smoothed_any_ || !measured.exact;
    return smoothed(std::move(measured), turns.points);
  };
  field_ = take(signal(recording, recording.has(Channel::field) ? Channel::field : Channel::command));
  if (recording.has(Channel::displacement)) displacement_ = take(signal(recording, Channel::displacement));
  if (recording.has(Channel::force)) force_ = take(signal(recording, Channel::force));
  if (!recording.has(Channel::charge)) return;
  polarization_ = take(polarization(recording));
  centred_ = recording.header.charge_reference != ChargeReference::absolute;
  if (!centred_) return;
  if (const auto range = extremes(polarization_.values))
    for (auto& p : *polarization_.own) p -= 0.5 * (range->low + range->high);
}

std::optional<double> LoopMeter::stroke(std::size_t first, std::size_t last) const {
  return span_of(part(displacement_, first, last));
}

std::optional<double> LoopMeter::force_span(std::size_t first, std::size_t last) const {
  return span_of(part(force_, first, last));
}

std::optional<double> LoopMeter::displacement_area(std::size_t first, std::size_t last) const {
  return any_known(part(displacement_, first, last))
             ? std::optional(enclosed_area(part(field_, first, last), part(displacement_, first, last)))
             : std::nullopt;
}

LoopMeasures LoopMeter::measure(const Cycle& cycle) const {
  LoopMeasures out;
  const auto field = part(field_, cycle.first, cycle.last);
  out.force_span = force_span(cycle.first, cycle.last);
  const auto displacement = part(displacement_, cycle.first, cycle.last);
  if (const auto range = extremes(displacement)) {
    out.displacement_low = range->low;
    out.displacement_high = range->high;
    out.stroke = range->span();
    out.displacement_area = enclosed_area(field, displacement);
    const auto half = crossings(field, displacement, 0.5 * (range->low + range->high));
    if (half.size() >= 2) out.width = std::abs(half.back() - half.front());
  }
  const auto p = part(polarization_, cycle.first, cycle.last);
  if (!any_known(p)) return out;
  out.energy = loop_integral(field, p);
  for (std::size_t i = 1; i < p.size(); ++i) {
    const auto place = [&](std::span<const double> x, std::span<const double> y) {
      return x[i - 1] + (x[i] - x[i - 1]) * y[i - 1] / (y[i - 1] - y[i]);
    };
    if (p[i - 1] > 0 && p[i] <= 0) out.coercive_negative = place(field, p);
    if (p[i - 1] < 0 && p[i] >= 0) out.coercive_positive = place(field, p);
    if (field[i - 1] > 0 && field[i] <= 0) out.remanent_falling = place(p, field);
    if (field[i - 1] < 0 && field[i] >= 0) out.remanent_rising = place(p, field);
  }
  // A loop that begins at zero field passes it there.
  const double near_zero = 1e-3 * std::max(std::abs(cycle.low), std::abs(cycle.high));
  if (!out.remanent_rising && std::abs(field.front()) <= near_zero) out.remanent_rising = p.front();
  if (!out.remanent_falling && std::abs(field.back()) <= near_zero) out.remanent_falling = p.back();
  return out;
}

}  // namespace ferrobench::recordings
