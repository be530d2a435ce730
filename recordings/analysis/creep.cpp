#include "recordings/analysis/creep.h"

#include <algorithm>
#include <cmath>

#include "recordings/analysis/cycles.h"
#include "recordings/analysis/loops.h"
#include "recordings/analysis/segments.h"
#include "recordings/analysis/statistics.h"

namespace ferrobench::recordings {
namespace {

// Time from the hold's start and value, averaged over bins of a tenth of a decade.
struct LogBins {
  std::vector<double> log_time, time, value;
  std::vector<std::size_t> samples;
};

LogBins log_bins(const Recording& r, const Signal& signal, const Hold& hold, double from) {
  LogBins out;
  double log_sum = 0, time_sum = 0, value_sum = 0;
  std::size_t samples = 0;
  auto bin = std::numeric_limits<double>::quiet_NaN();
  const auto close = [&] {
    if (samples == 0) return;
    const auto count = static_cast<double>(samples);
    out.samples.push_back(samples);
    out.log_time.push_back(log_sum / count);
    out.time.push_back(time_sum / count);
    out.value.push_back(value_sum / count);
    log_sum = time_sum = value_sum = 0;
    samples = 0;
  };
  for (std::size_t i = hold.first + 1; i <= hold.last; ++i) {
    const double t = r.time[i] - r.time[hold.first];
    if (t < from || std::isnan(signal.values[i])) continue;
    const double log_time = std::log10(t);
    if (std::floor(10 * log_time) != bin) {
      close();
      bin = std::floor(10 * log_time);
    }
    log_sum += log_time;
    time_sum += t;
    value_sum += signal.values[i];
    ++samples;
  }
  close();
  return out;
}

std::optional<double> half_time(const std::vector<double>& time, const std::vector<double>& value,
                                double start, double change) {
  double time_before = 0, done_before = 0;
  for (std::size_t i = 0; i < time.size(); ++i) {
    const double done = (value[i] - start) / change;
    if (std::isnan(done)) continue;
    if (done >= 0.5)
      return time_before + (time[i] - time_before) * (0.5 - done_before) / (done - done_before);
    time_before = time[i];
    done_before = done;
  }
  return std::nullopt;
}

Estimate log_slope(const LogBins& bins, const Signal& signal) {
  const auto line = fit_line(bins.log_time, bins.value);
  double squares = 0, variance = 0;
  for (std::size_t k = 0; k < bins.value.size(); ++k) {
    const double square = std::pow(bins.log_time[k] - line.x0, 2);
    squares += square;
    variance += square * signal.statistics.variance_of_mean(bins.samples[k]);
  }
  return {line.slope, std::sqrt(variance) / squares, signal.gain_uncertainty * std::abs(line.slope)};
}

}  // namespace

std::vector<Hold> find_holds(const Recording& recording) {
  std::vector<Hold> out;
  const auto segments = segments_of(recording);
  for (std::size_t k = 0; k < segments.size(); ++k) {
    const auto& row = segments[k];
    if (row.kind != "hold" || row.end_sample - row.start_sample < 10) continue;
    const auto first = static_cast<std::size_t>(row.start_sample);
    const auto last = std::min(static_cast<std::size_t>(row.end_sample), recording.size() - 1);
    const bool after_ramp = k > 0 && segments[k - 1].kind == "ramp";
    out.push_back({out.size() + 1, first, last, row.level, recording.time[last] - recording.time[first],
                   after_ramp ? segments[k - 1].rate : 0, row.label});
  }
  return out;
}

std::vector<Hold> long_holds(const Recording& recording, const std::vector<BiasSine>& sines) {
  auto holds = find_holds(recording);
  std::erase_if(holds, [&](const Hold& hold) {
    return std::ranges::find(sines, hold.last, &BiasSine::first) != sines.end();
  });
  double longest = 0;
  for (const auto& hold : holds) longest = std::max(longest, hold.duration);
  std::erase_if(holds, [&](const Hold& hold) { return hold.duration < 0.5 * longest; });
  return holds;
}

std::optional<Estimate> creep_after(const Recording& recording, const Signal& signal, const Hold& hold,
                                    double seconds) {
  const auto begin = recording.time.begin() + static_cast<std::ptrdiff_t>(hold.first);
  const auto end = recording.time.begin() + static_cast<std::ptrdiff_t>(hold.last) + 1;
  // The index of the first sample so late.
  const auto at = [&](double after) {
    return static_cast<std::size_t>(std::lower_bound(begin, end, *begin + after) - recording.time.begin());
  };
  constexpr double half_bin = 0.05, rounding = 1e-9;  // decades; of a time
  constexpr std::size_t fewest = 8;
  const double factor = std::pow(10, half_bin);
  auto first = at(seconds / factor), last = at(seconds * factor);
  Reading reading;
  if (signal.exact || last - first < fewest) {
    const auto next = at(seconds * (1 - rounding));
    if (next > hold.last || next == hold.first) return std::nullopt;
    const double before = recording.time[next - 1], after = recording.time[next];
    const double share = std::min(1.0, (*begin + seconds - before) / (after - before));
    reading.weights = {{next - 1, 1 - share}, {next, share}};
  } else {
    if (last > hold.last) return std::nullopt;
    for (; first < last; ++first)
      if (!std::isnan(signal.values[first])) reading.weights.push_back({first, 1});
    for (auto& w : reading.weights) w.weight /= static_cast<double>(reading.weights.size());
  }
  for (const auto& w : reading.weights) reading.value += w.weight * signal.values[w.sample];
  const auto start = edge_reading(recording, signal, hold.first, hold.last - hold.first + 1, false);
  if (reading.weights.empty() || !std::isfinite(reading.value - start.value)) return std::nullopt;
  return signal.estimate(reading - start);
}

std::vector<CreepCurve> creep_curves(const Recording& r, const Signal& signal,
                                     const std::vector<BiasSine>& sines) {
  constexpr std::size_t most = 16;
  constexpr double bins = 40;  // in a decade
  auto holds = long_holds(r, sines);
  if (holds.size() > most) holds.resize(most);
  std::vector<CreepCurve> out;
  for (const auto& hold : holds) {
    auto& curve = out.emplace_back(CreepCurve{.hold = hold, .time = {}, .change = {}});
    const double start = edge_reading(r, signal, hold.first, hold.last - hold.first + 1, false).value;
    std::vector<double> times, values;
    double bin = NAN;
    const auto close = [&] {
      if (times.empty()) return;
      curve.time.push_back(mean(times));
      curve.change.push_back(mean(values) - start);
      times.clear();
      values.clear();
    };
    for (std::size_t i = hold.first + 1; i <= hold.last; ++i) {
      const double t = r.time[i] - r.time[hold.first];
      if (std::floor(bins * std::log10(t)) != bin) close();
      bin = std::floor(bins * std::log10(t));
      times.push_back(t);
      values.push_back(signal.values[i]);
    }
    close();
  }
  return out;
}

std::vector<double> reading_times(const Recording& recording, const std::vector<Hold>& holds) {
  double from = INFINITY, to = 0;
  for (const auto& hold : holds) {
    from = std::min(from, 2.5 * (recording.time[hold.first + 1] - recording.time[hold.first]));
    to = std::max(to, hold.duration);
  }
  std::vector<double> out;
  if (!(from > 0) || !(from < to)) return out;
  for (int decade = static_cast<int>(std::floor(std::log10(from))); std::pow(10, decade) <= to; ++decade)
    for (const double digit : {1, 2, 5})
      if (const double t = digit * std::pow(10, decade); t >= from && t <= to) out.push_back(t);
  return out;
}

Creep measure_creep(const Recording& recording, const Signal& signal, const Hold& hold) {
  const auto count = hold.last - hold.first + 1;
  Creep out;
  const auto start = edge_reading(recording, signal, hold.first, count, false),
             end = edge_reading(recording, signal, hold.first, count, true);
  out.change = signal.estimate(end - start);

  const double step = recording.time[hold.first + 1] - recording.time[hold.first];
  const auto bins = log_bins(recording, signal, hold, std::max(0.01 * hold.duration, 2.5 * step));
  if (bins.value.size() >= 5) out.per_decade = log_slope(bins, signal);

  // Without noise every sample tells; with it, means over a tenth of a decade do.
  std::vector<double> time, value;
  if (signal.exact) {
    for (std::size_t i = hold.first; i <= hold.last; ++i) {
      time.push_back(recording.time[i] - recording.time[hold.first]);
      value.push_back(signal.values[i]);
    }
  } else {
    auto all = log_bins(recording, signal, hold, 0);
    time = std::move(all.time);
    value = std::move(all.value);
    value.push_back(start.value);
    value.push_back(end.value);
    time.push_back(hold.duration);
    time.push_back(hold.duration);
  }
  if (const auto range = extremes(value)) out.range = range->span();
  // A change that noise explains has no half.
  if (std::abs(out.change.value) > 3 * signal.noise && out.change.value != 0)
    out.time_to_half = half_time(time, value, start.value, out.change.value);
  return out;
}

}  // namespace ferrobench::recordings
