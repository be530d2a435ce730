#include "recordings/exchange/conversion/checks.h"

#include <algorithm>
#include <cmath>

#include "base/number_text.h"

namespace ferrobench::recordings {
namespace {

std::string percent(double share) {
  constexpr double told = 1e-5;
  return share < told ? "less than 0.001 %" : number_text(100 * share) + " %";
}

// The first row of each block, and the end.
std::vector<std::size_t> edges_of(std::span<const std::size_t> blocks, std::size_t rows) {
  std::vector<std::size_t> out{0};
  out.insert(out.end(), blocks.begin(), blocks.end());
  out.push_back(rows);
  return out;
}

// The row at which `charge` leaves the integral by a step, and by how much of the range.
std::pair<std::size_t, double> largest_step(std::span<const double> charge, std::span<const double> integral,
                                            double range, std::span<const std::size_t> blocks) {
  std::pair<std::size_t, double> out{0, 0};
  for (std::size_t i = 1; i < charge.size(); ++i) {
    if (std::ranges::find(blocks, i) != blocks.end()) continue;
    const double step = std::abs((charge[i] - charge[i - 1]) - (integral[i] - integral[i - 1])) / range;
    if (step > out.second) out = {i, step};
  }
  return out;
}

}  // namespace

Range range_of(std::span<const double> values) {
  Range out;
  for (const double v : values)
    if (std::isfinite(v)) out = {std::min(out.low, v), std::max(out.high, v)};
  return out;
}

Values integral(std::span<const double> time, std::span<const double> current) {
  Values out(time.size());
  for (std::size_t i = 1; i < time.size(); ++i) {
    const double step = 0.5 * (current[i] + current[i - 1]) * (time[i] - time[i - 1]);
    out[i] = out[i - 1] + (std::isfinite(step) ? step : 0);
  }
  return out;
}

std::optional<Agreement> agreement(std::span<const double> time, std::span<const double> current,
                                   std::span<const double> polarization, double area,
                                   std::span<const std::size_t> blocks) {
  const auto charge = integral(time, current);
  const auto edges = edges_of(blocks, time.size());
  double both = 0, squares = 0, own = 0, count = 0;
  Agreement out;
  for (std::size_t b = 0; b + 1 < edges.size(); ++b) {
    const auto first = edges[b];
    const auto range = range_of(polarization.subspan(first, edges[b + 1] - first));
    if (range.span() > 0) out.range = std::max(out.range, area * range.span());
    for (auto i = first; i < edges[b + 1]; ++i) {
      const double p = area * (polarization[i] - polarization[first]), q = charge[i] - charge[first];
      if (!std::isfinite(p) || !std::isfinite(q)) continue;
      both += p * q, squares += q * q, own += p * p, ++count;
    }
  }
  if (!(squares > 0) || !(out.range > 0)) return std::nullopt;
  out.slope = both / squares;
  out.rms = std::sqrt(std::max(0.0, own - out.slope * both) / count) / out.range;
  return out;
}

std::int64_t check_polarization(Measured& m, const Specimen& specimen, bool layers_given) {
  if (!m.polarization || !m.current) return specimen.layer_count;
  const auto found = agreement(m.time, *m.current, *m.polarization, m.area, m.blocks);
  if (!found) return specimen.layer_count;
  // An offset in the current or a wrong area makes some percent, two layers or more a factor.
  constexpr double near = 0.2, exact = 5e-3;
  const auto layers = static_cast<double>(specimen.layer_count);
  const auto distance = [](double slope) { return std::abs(std::log(std::abs(slope))); };
  const double of_one = distance(found->slope), of_all = distance(found->slope * layers);
  const auto counted = of_one < of_all && of_one < std::log1p(near) ? 1 : specimen.layer_count;
  const double slope = found->slope * static_cast<double>(counted);
  const auto stated = (layers_given ? "" : "the header names ") + std::to_string(specimen.layer_count) +
                      " layers" + (layers_given ? " are given" : "");
  if (counted != specimen.layer_count)
    m.say("warning", stated + ", but the polarization is the charge over the area of one: " +
                         (layers_given ? "the charge is that of one" : "one is taken"));
  else if (counted > 1 && !(of_all < std::log1p(near)))
    m.say("warning", stated + ", but the polarization follows the current neither with these nor with one: " +
                         "these are kept");
  const bool good = std::abs(slope - 1) < exact && found->rms < exact;
  m.say(good ? "check" : "warning",
        "A dP against the integral of I dt: they differ by " + percent(std::abs(slope - 1)) + ", and by " +
            percent(found->rms) + " of the range (rms); so the " +
            (m.area == specimen.area ? "area of " : "file's area of ") + number_text(m.area) + " m^2 " +
            (good ? "holds" : "is " + number_text(m.area / slope) + " m^2 by the current"));
  Values charge(m.time.size());
  for (std::size_t i = 0; i < charge.size(); ++i)
    charge[i] = m.area * static_cast<double>(counted) * (*m.polarization)[i];
  const auto [row, step] = largest_step(charge, integral(m.time, *m.current),
                                        found->range * static_cast<double>(counted), m.blocks);
  if (constexpr double jump = 0.01; step > jump)
    m.say("warning",
          m.place(row) + ": the polarization leaves the integral of the current by " + percent(step) +
              " of the range in one step",
          m.time[row]);
  return counted;
}

void check_charge(Measured& m) {
  const auto& charge = m.channel(Channel::charge);
  if (!charge || !m.current) return;
  const auto found = agreement(m.time, *m.current, *charge, 1, m.blocks);
  if (!found) return;
  constexpr double exact = 0.01;
  const bool good = std::abs(found->slope - 1) < exact && found->rms < exact;
  m.say(good ? "check" : "warning", "charge against the integral of the current: they differ by " +
                                        percent(std::abs(found->slope - 1)) + ", and by " +
                                        percent(found->rms) + " of the range (rms)");
}

void check_voltage(Measured& m) {
  if (!m.voltage || !m.amplitude || !(*m.amplitude > 0)) return;
  const auto range = range_of(*m.voltage);
  if (!(range.low < 0 && range.high > 0)) return;
  constexpr double small = 5e-3, far = 0.05;
  const double offset = range.middle() / *m.amplitude, height = range.span() / 2 / *m.amplitude;
  const auto measured = number_text(range.low) + " to " + number_text(range.high) + " V";
  if (std::abs(offset) > small)
    m.say("warning", "the measured voltage lies " + number_text(std::abs(range.middle())) + " V " +
                         (offset > 0 ? "above" : "below") + " what was asked for (+-" +
                         number_text(*m.amplitude) + " V, measured " + measured + "): kept as measured");
  else
    m.say("check", "the measured voltage, " + measured + ", lies around zero to " +
                       percent(std::abs(offset)) + " of the " + number_text(*m.amplitude) +
                       " V that were asked for");
  if (std::abs(height - 1) > far)
    m.say("warning", "the measured voltage reaches " + percent(height) + " of the " +
                         number_text(*m.amplitude) + " V that were asked for");
}

void check_energy(Measured& m) {
  const auto& charge = m.channel(Channel::charge);
  const auto& field = m.channel(Channel::field);
  if (!charge || !field || !m.current || m.conducts) return;
  double work = 0;
  for (std::size_t i = 1; i < charge->size(); ++i) {
    const double step = 0.5 * ((*field)[i] + (*field)[i - 1]) * ((*charge)[i] - (*charge)[i - 1]);
    if (std::isfinite(step)) work += step;
  }
  constexpr double clearly = 0.05;
  const double most = range_of(*field).span() * range_of(*charge).span();
  if (!(work < -clearly * most)) return;
  m.say("warning",
        "the charge runs against the field: a specimen would give energy, loop by loop. The current has the "
        "sign of "
        "the other electrode; in a map, a scale of -1 beside its unit turns it");
}

}  // namespace ferrobench::recordings
