#include "recordings/analysis/loop_measures.h"

#include <array>
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

struct Span {
  Reading low, high;
};
std::optional<Span> span_of(const Signal& signal, std::size_t first, std::size_t last) {
  const auto range = extremes(part(signal, first, last));
  if (!range) return std::nullopt;
  return Span{signal.extreme(first + range->low_at), signal.extreme(first + range->high_at)};
}

std::optional<Estimate> span_estimate(const Signal& signal, std::size_t first, std::size_t last) {
  const auto span = span_of(signal, first, last);
  return span ? std::optional(signal.estimate(span->high - span->low)) : std::nullopt;
}

// Where a loop passes a level: between two samples.
struct Place {
  std::size_t before = 0, after = 0;
  double share = 0;
  Reading of(const Signal& signal) const {
    if (share == 0) return signal.reading(before);
    return (1 - share) * signal.reading(before) + share * signal.reading(after);
  }
};

constexpr double hardly_noise = 5;  // standard deviations that noise hardly makes

// Whether y passes what it has there only once, as far as noise of this deviation lets one see, and does not
// stay there for more than two of the windows by which it is read.
bool once(const Signal& y, const Place& at, double deviation, std::size_t first, std::size_t last) {
  const double level = y.values[at.before] + at.share * (y.values[at.after] - y.values[at.before]);
  const auto is_near = [&](std::size_t i) {
    return std::abs(y.values[i] - level) <= hardly_noise * deviation;
  };
  std::size_t from = at.before, to = at.after;
  while (from > first && is_near(from)) --from;
  while (to < last && is_near(to)) ++to;
  const std::size_t window =
      y.fits ? y.fits->reach[at.before].before + y.fits->reach[at.before].after + 1 : 1;
  return to - from <= 2 * window + 2 && crossings(y.values.subspan(from, to - from + 1), level).size() <= 1;
}

// dx/dy there, over the window by which y is read; within the samples first..last.
double slope(const Signal& x, const Signal& y, const Place& at, std::size_t first, std::size_t last) {
  const std::size_t wide = y.fits ? std::max<std::size_t>(y.fits->reach[at.before].after, 1) : 0;
  const auto from = std::max(first + wide, at.before) - wide, to = std::min(last, at.after + wide);
  const double change = y.values[to] - y.values[from];
  return change != 0 ? (x.values[to] - x.values[from]) / change : 0;
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
  if (const auto span = span_of(polarization_, 0, recording.size() - 1))
    middle_ = 0.5 * (span->low + span->high);
}

std::optional<Estimate> LoopMeter::stroke(std::size_t first, std::size_t last) const {
  return span_estimate(displacement_, first, last);
}

std::optional<Estimate> LoopMeter::force_span(std::size_t first, std::size_t last) const {
  return span_estimate(force_, first, last);
}

std::optional<Estimate> LoopMeter::area(const Signal& y, double value, std::size_t first,
                                        std::size_t last) const {
  const auto squares = [&](const Signal& s) {
    double sum = 0;
    for (std::size_t i = first + 1; i < last; ++i)
      if (const double step = 0.5 * (s.values[i + 1] - s.values[i - 1]); !std::isnan(step))
        sum += step * step;
    return sum;
  };
  // The line that closes the loop goes from the field at one end to that at the other.
  const double closing = 0.5 * (y.values[first] - y.values[last]);
  const auto end = [&](std::size_t i) { return field_.statistics.variance(field_.reading(i).weights); };
  const double variance = y.statistics.variance_of_sum(squares(field_)) +
                          field_.statistics.variance_of_sum(squares(y)) +
                          (std::isnan(closing) ? 0 : closing * closing * (end(first) + end(last)));
  return Estimate{value, std::sqrt(variance),
                  std::abs(value) * std::hypot(y.gain_uncertainty, field_.gain_uncertainty)};
}

std::optional<Estimate> LoopMeter::displacement_area(std::size_t first, std::size_t last) const {
  const auto x = part(displacement_, first, last);
  if (!any_known(x)) return std::nullopt;
  const auto field = part(field_, first, last);
  const auto out = area(displacement_, enclosed_area(field, x), first, last);
  // Where both ways lie closer than their noise its sign is lost, and it adds up: to about as much as the
  // area between them there.
  constexpr double much = 0.3;
  const auto middle = displacement_.reading(first + (last - first) / 4);
  const double limit = std::sqrt(2 * displacement_.statistics.variance(middle.weights));
  if (out->value < 3 * out->noise || thin_area(field, x, limit) > much * out->noise)
    return Estimate{out->value};
  return out;
}

LoopMeasures LoopMeter::measure(const Cycle& cycle) const {
  const auto first = cycle.first, last = cycle.last;
  LoopMeasures out;
  out.stroke = stroke(first, last);
  out.force_span = force_span(first, last);
  out.displacement_area = displacement_area(first, last);
  // While the field rests at a turn the displacement creeps, and the field's noise makes area of it.
  constexpr std::size_t rest = 10;
  if (out.displacement_area &&
      std::ranges::any_of(cycle.turns, [](const Turn& t) { return t.leave - t.arrive > rest; }))
    out.displacement_area = Estimate{out.displacement_area->value};
  // What x is where y, less what it passes there, is none.
  const auto passing = [&](const Signal& x, const Reading& at_x, const Signal& y, const Reading& at_y,
                           const Place& place) {
    auto estimate = x.estimate(at_x);
    const double deviation = std::sqrt(y.statistics.variance(at_y.weights));
    if (!once(y, place, deviation, first, last)) return Estimate{estimate.value};
    estimate.noise = std::hypot(estimate.noise, slope(x, y, place, first, last) * deviation);
    return estimate;
  };
  if (const auto span = span_of(displacement_, first, last)) {
    const auto level = 0.5 * (span->low + span->high);
    const auto half = crossings(part(displacement_, first, last), level.value);
    if (half.size() >= 2) {
      const auto at = [&](const Crossing& c) { return Place{first + c.before, first + c.after, c.share}; };
      const auto outward = at(half.front()), back = at(half.back());
      const auto width = abs(back.of(field_) - outward.of(field_));
      // Both sides move with the displacement there, and with what half the stroke is read from.
      const double s_out = slope(field_, displacement_, outward, first, last),
                   s_back = slope(field_, displacement_, back, first, last);
      const auto moved =
          s_back * (back.of(displacement_) - level) - s_out * (outward.of(displacement_) - level);
      const double deviation =
          std::sqrt(displacement_.statistics.variance((outward.of(displacement_) - level).weights));
      out.width = Estimate{width.value};
      if (once(displacement_, outward, deviation, first, last) &&
          once(displacement_, back, deviation, first, last)) {
        out.width = field_.estimate(width);
        out.width->noise =
            std::hypot(out.width->noise, std::sqrt(displacement_.statistics.variance(moved.weights)));
      }
    }
  }
  const auto p = part(polarization_, first, last), field = part(field_, first, last);
  if (!any_known(p)) return out;
  out.energy = area(polarization_, loop_integral(field, p), first, last);
  // The last passing counts, from either side.
  const auto last_passings = [&](const Signal& signal, double level) {
    const auto y = part(signal, first, last);
    // What noise does at the ends of the loop is no passing.
    const auto is_near = [&](std::size_t i) {
      const double deviation = std::sqrt(signal.statistics.variance(signal.reading(i).weights));
      return std::abs(signal.values[i] - level) < hardly_noise * deviation;
    };
    std::size_t from = first, to = last;
    while (from < last && is_near(from)) ++from;
    while (to > from && is_near(to)) --to;
    std::array<std::optional<Place>, 2> places;  // falling, rising
    for (const auto& c : crossings(y, level))
      if (y[c.before] != level && first + c.before >= from && first + c.after <= to)
        places.at(y[c.before] < level) = {first + c.before, first + c.after, c.share};
    return places;
  };
  const auto coercive = [&](const std::optional<Place>& at) {
    return at ? std::optional(
                    passing(field_, at->of(field_), polarization_, at->of(polarization_) - middle_, *at))
              : std::nullopt;
  };
  const auto remanent = [&](const std::optional<Place>& at) {
    return at ? std::optional(
                    passing(polarization_, at->of(polarization_) - middle_, field_, at->of(field_), *at))
              : std::nullopt;
  };
  const auto of_p = last_passings(polarization_, middle_.value), of_field = last_passings(field_, 0);
  out.coercive_negative = coercive(of_p[0]);
  out.coercive_positive = coercive(of_p[1]);
  out.remanent_falling = remanent(of_field[0]);
  out.remanent_rising = remanent(of_field[1]);
  // A loop that begins at zero field passes it there.
  const double near_zero = 1e-3 * std::max(std::abs(cycle.low), std::abs(cycle.high));
  const auto at_end = [&](std::size_t i) {
    return polarization_.estimate(polarization_.reading(i) - middle_);
  };
  if (!out.remanent_rising && std::abs(field.back()) <= near_zero && cycle.high <= near_zero)
    out.remanent_rising = at_end(last);
  if (!out.remanent_rising && std::abs(field.front()) <= near_zero) out.remanent_rising = at_end(first);
  if (!out.remanent_falling && std::abs(field.back()) <= near_zero) out.remanent_falling = at_end(last);
  return out;
}

}  // namespace ferrobench::recordings
