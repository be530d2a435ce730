#include "model/inference/dataset/drive.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "model/inference/dataset/refusal.h"
#include "model/on_recording.h"
#include "recordings/analysis/segments.h"
#include "recordings/analysis/statistics.h"

namespace ferrobench::model::inference {
namespace {

using recordings::Channel;
using recordings::Recording;

constexpr std::size_t most_knots = 4000;  // of a drive
constexpr std::size_t most_levels = 80;   // whose uncertainty is followed up
// A ramp that hardly bends moves what switches in it all the same: a bend of which one cannot be sure is
// followed up as well. By chance one ramp in eight has one.
constexpr double least_bend = 8;
constexpr std::size_t longest_memory = 1000;  // of the field's noise, samples

// Chords of a bent program (a sine, a filtered ramp) that stay within about `slack` of it.
std::vector<std::size_t> chords(const std::vector<double>& time, const std::vector<double>& field,
                                double slack) {
  std::vector<std::size_t> out{0};
  double low = -std::numeric_limits<double>::infinity(), high = -low;
  for (std::size_t i = 1; i < time.size(); ++i) {
    const auto slope_to = [&](double level) {
      return (level - field[out.back()]) / (time[i] - time[out.back()]);
    };
    low = std::max(low, slope_to(field[i] - slack));
    high = std::min(high, slope_to(field[i] + slack));
    if (low <= high) continue;
    out.push_back(i - 1);
    low = slope_to(field[i] - slack);
    high = slope_to(field[i] + slack);
  }
  out.push_back(time.size() - 1);
  return out;
}

// Calls visit(knot, u, field) for each sample that was measured: it lies at the share u of the way from
// knot - 1 to knot.
template <class Visit>
void for_each_sample(const BenchRecording& drive, const Recording& r, Visit&& visit) {
  const auto& field = r.at(Channel::field);
  std::size_t knot = 1;
  for (std::size_t i = 0; i < r.size(); ++i) {
    if (!std::isfinite(field[i])) continue;
    const double t = r.time[i] - r.time.front();
    while (knot + 1 < drive.knot_time.size() && t > drive.knot_time[knot]) ++knot;
    const double span = drive.knot_time[knot] - drive.knot_time[knot - 1];
    visit(knot, std::clamp((t - drive.knot_time[knot - 1]) / span, 0.0, 1.0), field[i]);
  }
}

// The levels by least squares, the times as they are: neighbours alone know of each other.
void fit_levels(BenchRecording& out, const Recording& r) {
  const auto n = static_cast<Eigen::Index>(out.level_of.back() + 1);
  Eigen::VectorXd own = Eigen::VectorXd::Constant(n, 1e-9), next = Eigen::VectorXd::Zero(n),
                  along = Eigen::VectorXd::Zero(n);
  for_each_sample(out, r, [&](std::size_t knot, double u, double field) {
    const auto a = static_cast<Eigen::Index>(out.level_of[knot - 1]),
               b = static_cast<Eigen::Index>(out.level_of[knot]);
    if (a == b) u = 0;  // a hold
    own[a] += (1 - u) * (1 - u);
    own[b] += u * u;
    next[a] += u * (1 - u);
    along[a] += (1 - u) * field;
    along[b] += u * field;
  });
  for (Eigen::Index k = 1; k < n; ++k) {
    const double share = next[k - 1] / own[k - 1];
    own[k] -= share * next[k - 1];
    along[k] -= share * along[k - 1];
  }
  for (Eigen::Index k = n; k-- > 0;)
    along[k] = (along[k] - (k + 1 < n ? next[k] * along[k + 1] : 0)) / own[k];
  out.knot_field.clear();
  for (const auto level : out.level_of) out.knot_field.push_back(along[static_cast<Eigen::Index>(level)]);
}

// The variance of a mean of many samples, times their number: that of one sample, and its covariances with
// its neighbours on both sides, as far as pairs of lags have a positive sum (Geyer, Statist. Sci. 7 (1992)
// 473).
double long_run_variance(std::span<const double> noise) {
  const auto covariance = [&](std::size_t lag) {
    double sum = 0;
    for (std::size_t i = lag; i < noise.size(); ++i) sum += noise[i] * noise[i - lag];
    return sum / static_cast<double>(noise.size());
  };
  double out = -covariance(0);
  for (std::size_t lag = 0; lag + 1 < noise.size() && lag < longest_memory; lag += 2) {
    const double pair = covariance(lag) + covariance(lag + 1);
    if (pair <= 0) break;
    out += 2 * pair;
  }
  return std::max(0.0, out);
}

// The knots by least squares over all samples of the measured field, from corners that are right to a sample;
// and what the field's noise leaves uncertain of them.
void fit_knots(BenchRecording& out, const Recording& r) {
  fit_levels(out, r);
  const std::size_t last = out.knot_time.size() - 1, levels = out.level_of.back() + 1;
  if (levels >= most_levels) {
    out.level_of.clear();
    return;
  }
  const auto n = static_cast<Eigen::Index>(levels + last - 1);
  const auto corners_found = out.knot_time;
  const double interval = (r.time.back() - r.time.front()) / static_cast<double>(r.size() - 1);
  std::vector<double> known;
  for (const double e : r.at(Channel::field))
    if (std::isfinite(e)) known.push_back(e);
  const auto [least, most] = std::ranges::minmax(known);
  // Exact steps have none.
  const double noise = std::max(recordings::estimate_noise(known), 1e-9 * (most - least));
  Eigen::MatrixXd normal(n, n);
  Eigen::VectorXd along(n);
  constexpr int rounds = 3;
  for (int round = 0; round < rounds; ++round) {
    normal.setZero();
    along.setZero();
    for_each_sample(out, r, [&](std::size_t knot, double u, double field) {
      const double span = out.knot_time[knot] - out.knot_time[knot - 1];
      const double rise = out.knot_field[knot] - out.knot_field[knot - 1];
      const double miss = field - out.knot_field[knot - 1] - u * rise;
      std::vector<std::pair<std::size_t, double>> parts{{out.level_of[knot - 1], 1 - u},
                                                        {out.level_of[knot], u}};
      if (knot >= 2) parts.emplace_back(levels + knot - 2, -(1 - u) * rise / span);
      if (knot < last) parts.emplace_back(levels + knot - 1, -u * rise / span);
      for (const auto& [row, weight] : parts) {
        along[static_cast<Eigen::Index>(row)] += weight * miss;
        for (const auto& [column, other] : parts)
          normal(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column)) += weight * other;
      }
    });
    // A corner that is hardly a bend cannot be dated: by itself its time is known to a sample.
    for (Eigen::Index k = 0; k < n; ++k)
      normal(k, k) += k < static_cast<Eigen::Index>(levels) ? 1e-9 : std::pow(noise / interval, 2);
    const Eigen::VectorXd step = normal.llt().solve(along);
    for (std::size_t k = 0; k <= last; ++k)
      out.knot_field[k] += step[static_cast<Eigen::Index>(out.level_of[k])];
    for (std::size_t k = 1; k < last; ++k) {
      // Stays within a sample of the corner, and away from its neighbours.
      const double room = std::min({interval, 0.4 * (corners_found[k] - corners_found[k - 1]),
                                    0.4 * (corners_found[k + 1] - corners_found[k])});
      out.knot_time[k] = std::clamp(out.knot_time[k] + step[static_cast<Eigen::Index>(levels + k - 1)],
                                    corners_found[k] - room, corners_found[k] + room);
    }
  }
  std::vector<double> misses;
  for_each_sample(out, r, [&](std::size_t knot, double u, double field) {
    misses.push_back(field - (1 - u) * out.knot_field[knot - 1] - u * out.knot_field[knot]);
  });
  // normal = L L^T, so noise * L^-T has the covariance of the knots, were the noise white.
  out.knot_error = std::max(noise, std::sqrt(long_run_variance(misses))) *
                   Eigen::MatrixXd(normal.llt().matrixU().solve(Eigen::MatrixXd::Identity(n, n)));
}

}  // namespace

// The drive as knots: the command at its corners, or the lines that its measured field runs along.
void set_drive(BenchRecording& out, const Recording& r) {
  const double origin = r.time.front();
  if (out.has_command) {
    std::vector<double> time, field;
    const auto& command = r.at(Channel::command);
    for (std::size_t i = 0; i < r.size(); ++i) {
      if (!std::isfinite(command[i])) continue;
      time.push_back(r.time[i] - origin);
      field.push_back(command[i]);
    }
    if (time.size() < 2) refuse(out.name, channel_path(Channel::command), "has fewer than two finite values");
    auto knots = corners(time, field);
    const auto [low, high] = std::ranges::minmax(field);
    double slack = 1e-5;
    while (knots.size() > most_knots && slack < 0.1) {
      knots = chords(time, field, slack * (high - low));
      slack *= 2;
    }
    for (const std::size_t knot : knots) {
      out.knot_time.push_back(time[knot]);
      out.knot_field.push_back(field[knot]);
    }
  } else {
    auto segments = recordings::infer_segments(r);
    if (2 * segments.size() < most_levels) segments = recordings::infer_segments(r, least_bend);
    if (segments.empty()) refuse(out.name, channel_path(Channel::field), "has fewer than two finite values");
    const auto at = [&](std::int64_t i) { return r.time[static_cast<std::size_t>(i)] - origin; };
    out.knot_time.push_back(0);
    out.level_of.push_back(0);
    for (const auto& s : segments) {
      const double end = &s == &segments.back() ? r.time.back() - origin : at(s.end_sample);
      if (end <= out.knot_time.back()) continue;
      out.knot_time.push_back(end);
      out.level_of.push_back(out.level_of.back() + (s.kind == "hold" ? 0 : 1));
    }
    fit_knots(out, r);
    return;
  }
  if (out.knot_time.front() > 0) {
    out.knot_time.insert(out.knot_time.begin(), 0);
    out.knot_field.insert(out.knot_field.begin(), out.knot_field.front());
  }
  if (const double end = r.time.back() - origin; out.knot_time.back() < end) {
    out.knot_time.push_back(end);
    out.knot_field.push_back(out.knot_field.back());
  }
}

BenchRecording BenchRecording::with_knots_moved(const Eigen::VectorXd& errors) const {
  auto out = *this;
  const auto levels = static_cast<Eigen::Index>(level_of.back() + 1);
  for (std::size_t k = 0; k < knot_time.size(); ++k) {
    out.knot_field[k] += errors[static_cast<Eigen::Index>(level_of[k])];
    if (k == 0 || k + 1 == knot_time.size()) continue;
    const double room = 0.4 * std::min(knot_time[k] - knot_time[k - 1], knot_time[k + 1] - knot_time[k]);
    out.knot_time[k] += std::clamp(errors[levels + static_cast<Eigen::Index>(k) - 1], -room, room);
  }
  return out;
}

}  // namespace ferrobench::model::inference
