#include "recordings/exchange/conversion/sample_checks.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "base/number_text.h"
#include "recordings/analysis/statistics.h"
#include "recordings/exchange/conversion/checks.h"

namespace ferrobench::recordings {
namespace {

double share_of(Values values, double share) {
  std::erase_if(values, [](double v) { return !std::isfinite(v); });
  if (values.empty()) return 0;
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, at);
  return *at;
}

// How far each sample lies from the median of five around it: nothing on a ramp or at a step, little at a
// turn, all of it for one or two that stand alone.
Values distances(std::span<const double> x) {
  Values out(x.size());
  for (std::size_t i = 2; i + 2 < x.size(); ++i) {
    std::array<double, 5> five{x[i - 2], x[i - 1], x[i], x[i + 1], x[i + 2]};
    std::ranges::nth_element(five, five.begin() + 2);
    out[i] = std::abs(x[i] - five[2]);
  }
  return out;
}

void find_spikes(Measured& m, const std::string& name, std::span<const double> values) {
  constexpr std::size_t least_rows = 16;
  Values x;
  std::vector<std::size_t> rows;  // gaps are passed over
  for (std::size_t i = 0; i < values.size(); ++i)
    if (!std::isnan(values[i])) x.push_back(values[i]), rows.push_back(i);
  if (x.size() < least_rows) return;
  const auto [low, high] = std::ranges::minmax(x);
  const auto far = distances(x);
  constexpr double share = 0.02, usual = 20, beyond_steps = 2.5;
  const double limit = std::max(share * (high - low), usual * median(far));
  // Where the values run fast, a turn lies farther from its neighbours.
  const auto local_step = [&x](std::size_t at) {
    constexpr std::size_t around = 5;
    Values steps;
    const auto end = std::min(at + around, x.size() - 1);
    for (auto i = at - std::min(at, around); i < end; ++i) steps.push_back(std::abs(x[i + 1] - x[i]));
    return median(std::move(steps));
  };
  std::size_t found = 0, first = 0;
  for (std::size_t i = 0; i < far.size(); ++i)
    if (far[i] > limit && far[i] > beyond_steps * local_step(i) && found++ == 0) first = i;
  if (found == 0) return;
  m.say("warning",
        (found == 1 ? "one sample of the " : std::to_string(found) + " samples of the ") + name +
            (found == 1 ? " lies" : " lie") + " far beside the others around, " +
            (found == 1 ? "in " : "first in ") + m.place(rows[first]) + ": " + number_text(x[first]),
        m.time[rows[first]]);
}

}  // namespace

void check_duration(Measured& m) {
  if (!m.frequency || !(*m.frequency > 0) || m.time.size() < 3 || !m.blocks.empty()) return;
  constexpr double part = 0.01;
  const auto rows = static_cast<double>(m.time.size());
  const double duration = m.time.back() - m.time.front();
  const double periods = duration * *m.frequency;
  // From zero to the end of the period; testers that begin later count the last point or leave it out.
  const double share = std::abs(periods - std::round(periods)) / std::max(1.0, periods);
  const double allowed = m.time.front() == 0 ? 0.4 / rows : part + 1.5 / rows;
  if (std::round(periods) >= 1 && share <= allowed) return;
  m.say("warning", "a loop at " + number_text(*m.frequency) + " Hz lasts " + number_text(1 / *m.frequency) +
                       " s, and these samples span " + number_text(duration) +
                       " s: some are missing, or the header is not theirs");
}

void check_return(Measured& m) {
  const auto& v = m.voltage ? m.voltage : m.channel(Channel::field);
  if (!m.returns || !v || v->size() < 3) return;
  const double span = range_of(*v).span();
  constexpr double near = 0.05;
  if (!(std::abs(v->back() - v->front()) > near * span)) return;
  const double share = (v->back() - v->front()) / span;
  m.say("warning", "the voltage does not end where it began, but " + number_text(100 * std::abs(share)) +
                       " % of its range " + (share > 0 ? "above" : "below") + ": was the file cut off?");
}

void check_steps(Measured& m) {
  constexpr std::size_t least_rows = 16;
  if (m.time.size() < least_rows) return;
  Values steps(m.time.size() - 1);
  for (std::size_t i = 0; i < steps.size(); ++i) steps[i] = m.time[i + 1] - m.time[i];
  constexpr double even = 0.02, nearly_all = 0.9, other = 0.3;
  const double usual = median(steps);
  // Steps that grow, or a logger that waits, are no even samples.
  if (std::abs(share_of(steps, nearly_all) - share_of(steps, 1 - nearly_all)) > even * usual) return;
  std::size_t found = 0, first = 0;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (std::abs(steps[i] - usual) < other * usual || std::ranges::find(m.blocks, i + 1) != m.blocks.end())
      continue;
    if (found++ == 0) first = i + 1;
  }
  if (found == 0) return;
  m.say("warning",
        (found == 1 ? "one step of the time is" : std::to_string(found) + " steps of the time are") +
            " not the usual " + number_text(usual) + " s, " + (found == 1 ? "in " : "first in ") +
            m.place(first) + ": samples are missing or changed there",
        m.time[first]);
}

void check_spikes(Measured& m) {
  if (m.voltage) find_spikes(m, "voltage", *m.voltage);
  for (const auto channel : all_channels)
    if (const auto& values = m.channel(channel); values && !(channel == Channel::field && m.voltage))
      find_spikes(m, std::string(channel_name(channel)), *values);
  if (m.polarization && !m.current) find_spikes(m, "polarization", *m.polarization);
  // What a polarization follows from has a better check.
  if (m.current && !m.polarization) find_spikes(m, "current", *m.current);
}

}  // namespace ferrobench::recordings
