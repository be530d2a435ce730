#include "model/inference/dataset/recording_data.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "model/on_recording.h"
#include "model/simulator.h"
#include "recordings/analysis/skew.h"

namespace ferrobench::model {
namespace {

constexpr std::size_t most_rows = 2000;
// Of the simplified drive, shares of the largest field. A smooth curve has sqrt(5) times fewer knots at the
// second one than at the first. Where there are more than four times fewer, most of the others were noise of
// the reading, which costs a simulation a step each.
constexpr double drive_tolerance = 2e-3, tolerance_of_noise = 1e-2;
constexpr std::size_t fewer_without_noise = 4;

MeasuredColumn column_of(const std::vector<double>& measured, recordings::Channel channel,
                         const std::vector<std::size_t>& rows) {
  MeasuredColumn out{.channel = channel, .rows = {}, .value = {}, .range = 0};
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double v : measured)
    if (std::isfinite(v)) {
      low = std::min(low, v);
      high = std::max(high, v);
    }
  out.range = high > low ? high - low : 0;
  double sum = 0;
  for (std::size_t k = 0; k < rows.size(); ++k)
    if (std::isfinite(measured[rows[k]])) {
      out.rows.push_back(k);
      out.value.push_back(measured[rows[k]]);
      sum += measured[rows[k]];
    }
  for (double& v : out.value) v -= sum / static_cast<double>(out.value.size());
  return out;
}

}  // namespace

double mean_pace(std::span<const double> time, std::span<const double> field) {
  if (time.size() < 2) return 0;
  double path = 0;
  for (std::size_t k = 1; k < field.size(); ++k) path += std::abs(field[k] - field[k - 1]);
  return path > 0 ? path / (time.back() - time.front()) : 0;
}

double largest_field(std::span<const double> field) {
  double largest = 0;
  for (const double e : field) largest = std::max(largest, std::abs(e));
  return largest;
}

Evidence evidence_of(std::span<const RecordingData> recordings) {
  Evidence out{.shows_elasticity = recordings.empty()};
  for (const auto& r : recordings) {
    out.largest_field = std::max(out.largest_field, largest_field(r.drive.field));
    const auto& load = r.header.load;
    const auto& specimen = r.header.specimen;
    out.shows_elasticity = out.shows_elasticity || load.spring_stiffness != 0 || load.prestress != 0;
    const double electrodes = static_cast<double>(specimen.layer_count) * specimen.area;
    for (const auto& column : r.columns)
      if (column.channel == recordings::Channel::charge)
        out.largest_polarization = std::max(out.largest_polarization, 0.5 * column.range / electrodes);
      else
        out.shows_elasticity = true;
  }
  return out;
}

Drive simplify(const Drive& drive, double tolerance) {
  const auto& [t, e] = drive;
  std::vector<bool> keep(t.size(), false);
  if (t.empty()) return drive;
  keep.front() = keep.back() = true;
  std::vector<std::pair<std::size_t, std::size_t>> open{{0, t.size() - 1}};
  while (!open.empty()) {
    const auto [from, to] = open.back();
    open.pop_back();
    std::size_t farthest = from;
    double distance = tolerance;
    for (std::size_t i = from + 1; i < to; ++i) {
      const double line = e[from] + (e[to] - e[from]) * (t[i] - t[from]) / (t[to] - t[from]);
      if (const double d = std::abs(e[i] - line); d > distance) {
        distance = d;
        farthest = i;
      }
    }
    if (farthest == from) continue;
    keep[farthest] = true;
    open.emplace_back(from, farthest);
    open.emplace_back(farthest, to);
  }
  Drive out;
  for (std::size_t i = 0; i < t.size(); ++i)
    if (keep[i]) {
      out.time.push_back(t[i]);
      out.field.push_back(e[i]);
    }
  return out;
}

RecordingData prepare(recordings::Recording r) {
  recordings::remove_skew(r);
  RecordingData out;
  const auto field = played_field(r);
  std::vector<std::size_t> known;
  for (std::size_t i = 0; i < r.size(); ++i)
    if (std::ranges::any_of(predicted_channels,
                            [&](auto c) { return r.has(c) && std::isfinite(r.at(c)[i]); }))
      known.push_back(i);
  std::vector<std::size_t> rows;
  const auto count = std::min(most_rows, known.size());
  for (std::size_t k = 0; k < count; ++k) rows.push_back(known[k * known.size() / count]);
  for (const auto row : rows) out.time.push_back(r.time[row] - r.time.front());
  for (const auto channel : predicted_channels) {
    if (!r.has(channel)) continue;
    auto column = column_of(r.at(channel), channel, rows);
    const auto name = r.header.title + ", " + std::string(recordings::channel_name(channel));
    if (column.range > 0 && !column.value.empty())
      out.columns.push_back(std::move(column));
    else
      out.unused.push_back(name +
                           (std::ranges::any_of(r.at(channel), [](double v) { return std::isfinite(v); })
                                ? " never changes"
                                : " has no finite value"));
  }
  for (const auto knot : corners(r.time, field)) {
    out.drive.time.push_back(r.time[knot] - r.time.front());
    out.drive.field.push_back(field[knot]);
  }
  const double largest = largest_field(field);
  out.simplified = simplify(out.drive, drive_tolerance * largest);
  if (auto smooth = simplify(out.drive, tolerance_of_noise * largest);
      fewer_without_noise * smooth.time.size() < out.simplified.time.size())
    out.simplified = std::move(smooth);
  out.header = std::move(r.header);
  out.past = out.header.past;
  return out;
}

}  // namespace ferrobench::model
