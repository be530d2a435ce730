#include "model/discrepancy/bench.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <span>

#include "model/on_recording.h"
#include "model/simulator.h"
#include "recordings/analysis/segments.h"
#include "recordings/analysis/statistics.h"

namespace ferrobench::model::discrepancy {
namespace {

using recordings::Channel;
using recordings::Recording;

constexpr std::size_t most_knots = 4000;  // of a drive
constexpr std::size_t most_levels = 80;   // whose uncertainty is followed up
// A ramp that hardly bends moves what switches in it all the same: a bend of which one cannot be sure is
// followed up as well. By chance one ramp in eight has one.
constexpr double least_bend = 8;
constexpr std::size_t longest_memory = 1000;  // of the field's noise, samples
constexpr const char* in_si = "every channel is in SI units: V/m, C, m, N";
constexpr double most_measured = 1e15;  // in SI units: whose squares can still be summed, by far

[[noreturn]] void refuse(const std::string& name, const std::string& path, const std::string& message,
                         const std::string& hint = "") {
  throw Error(ErrorCode::bad_recording, "the recording " + name + " cannot be used",
              Problem{.path = path, .message = message, .hint = hint});
}

std::string path_of(Channel channel) {
  return "/entry/data/" + std::string(recordings::channel_name(channel));
}

void check_time(const std::string& name, const Recording& r) {
  if (r.size() < 16) refuse(name, "/entry/data/time", "has fewer than 16 samples");
  for (std::size_t i = 0; i < r.size(); ++i)
    if (!std::isfinite(r.time[i]) || (i > 0 && r.time[i] <= r.time[i - 1]))
      refuse(name, "/entry/data/time", "does not rise at sample " + std::to_string(i));
}

void check_values(const std::string& name, const Recording& r) {
  for (const auto channel : recordings::all_channels) {
    if (!r.has(channel)) continue;
    for (const double v : r.at(channel))
      if (std::isfinite(v) && std::abs(v) > most_measured)
        refuse(name, path_of(channel), fmt::format("holds {:.3g}, which nothing measures", v),
               std::string("it may be damaged; ") + in_si);
  }
}

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
    if (time.size() < 2) refuse(out.name, path_of(Channel::command), "has fewer than two finite values");
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
    if (segments.empty()) refuse(out.name, path_of(Channel::field), "has fewer than two finite values");
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

// Rows: all samples, or so many that those after each corner stay dense and the others are evenly thinned.
std::vector<std::size_t> choose_rows(const Recording& r, const std::vector<double>& knots, std::size_t most) {
  const std::size_t n = r.size();
  std::vector<std::size_t> out;
  if (n <= most) {
    for (std::size_t i = 0; i < n; ++i) out.push_back(i);
    return out;
  }
  std::set<std::size_t> chosen;
  const std::size_t dense = most / 3 / std::max<std::size_t>(1, knots.size());
  for (const double knot : knots) {
    auto i = static_cast<std::size_t>(std::lower_bound(r.time.begin(), r.time.end(), r.time.front() + knot) -
                                      r.time.begin());
    double step = 1;
    for (std::size_t k = 0; k < dense && i < n; ++k) {
      chosen.insert(i);
      i += static_cast<std::size_t>(step);
      step *= 1.05;
    }
  }
  const std::size_t even = most - std::min(most, chosen.size());
  for (std::size_t k = 0; k < even; ++k) chosen.insert(k * n / even);
  out.assign(chosen.begin(), chosen.end());
  return out;
}

void add_channels(BenchRecording& out, const Recording& r, const std::vector<std::size_t>& rows,
                  std::vector<std::string>& warnings) {
  for (const auto channel : compared_channels) {
    if (!r.has(channel) || (channel == Channel::field && !out.has_command)) continue;
    const auto& all = r.at(channel);
    double low = std::numeric_limits<double>::infinity(), high = -low;
    std::size_t finite = 0;
    std::vector<double> known;
    for (const double v : all) {
      if (!std::isfinite(v)) continue;
      ++finite;
      low = std::min(low, v);
      high = std::max(high, v);
      known.push_back(v);
    }
    const std::string label = std::string(recordings::channel_name(channel)) + " of " + out.name;
    if (finite < 16) {
      warnings.push_back(label + " has next to no finite value and was left out.");
      continue;
    }
    if (!(high > low)) {
      warnings.push_back(label + " is constant and was left out: not connected?");
      continue;
    }
    MeasuredChannel m;
    m.channel = channel;
    m.range = high - low;
    m.scatter = recordings::estimate_noise(known);
    m.offset_is_free =
        channel == Channel::charge && r.header.charge_reference == recordings::ChargeReference::first_sample;
    for (const std::size_t row : rows) m.value.push_back(std::isfinite(all[row]) ? all[row] : NAN);
    out.channels.push_back(std::move(m));
  }
}

struct Leg {
  double begin = 0, end = 0, slope = 0, level = 0;
};

// Ramps and holds; chords of a bent program that go on in the same direction make one ramp.
std::vector<Leg> legs_of(const BenchRecording& r) {
  std::vector<Leg> out;
  double largest = 1e-300;
  for (const double e : r.knot_field) largest = std::max(largest, std::abs(e));
  for (std::size_t k = 1; k < r.knot_time.size(); ++k) {
    const double span = r.knot_time[k] - r.knot_time[k - 1];
    const double change = r.knot_field[k] - r.knot_field[k - 1];
    const double slope = std::abs(change) < 1e-6 * largest ? 0 : change / span;
    if (!out.empty() && ((slope > 0 && out.back().slope > 0) || (slope < 0 && out.back().slope < 0) ||
                         (slope == 0 && out.back().slope == 0)))
      out.back().end = r.knot_time[k];
    else
      out.push_back({r.knot_time[k - 1], r.knot_time[k], slope, r.knot_field[k]});
  }
  return out;
}

// A row switches where the model's charge moves clearly more than permittivity alone would have it.
void set_stretches(BenchRecording& r, const Model& model, const SimulationOptions& roughly) {
  auto with_charge = r;
  with_charge.channels = {{.channel = Channel::charge, .value = std::vector<double>(r.time.size())},
                          {.channel = Channel::field, .value = std::vector<double>(r.time.size())}};
  const auto simulated = simulate_bench(model, with_charge, roughly);
  const auto m = model_for(model, r.header);
  const double reversible = 2 * std::max(model.material.permittivity_180, model.material.permittivity_90) *
                            m.actuator.area * static_cast<double>(m.actuator.layer_count);
  const double largest = *std::max_element(r.knot_field.begin(), r.knot_field.end(),
                                           [](double a, double b) { return std::abs(a) < std::abs(b); });
  const auto legs = legs_of(r);
  r.stretch.assign(r.time.size(), Stretch::rest);
  std::size_t row = 0;
  for (std::size_t l = 0; l < legs.size(); ++l) {
    const auto& leg = legs[l];
    const bool last = l + 1 == legs.size();
    const bool turned = l > 0 && leg.slope * legs[l - 1].slope < 0;
    bool switched = false;
    for (; row < r.time.size() && (last || r.time[row] < leg.end); ++row) {
      const double since = (r.time[row] - leg.begin) / (leg.end - leg.begin);
      if (leg.slope == 0) {
        r.stretch[row] = std::abs(leg.level) < 0.01 * std::abs(largest) ? Stretch::rest
                         : since < 0.1                                  ? Stretch::hold_early
                                                                        : Stretch::hold_late;
        continue;
      }
      const std::size_t before = row > 0 ? row - 1 : row;
      const double moved = std::abs(simulated[0][row] - simulated[0][before]);
      const bool switching =
          moved > reversible * std::abs(simulated[1][row] - simulated[1][before]) && row != before;
      switched = switched || switching;
      r.stretch[row] = switching                ? Stretch::ramp_switching
                       : turned && since < 0.15 ? Stretch::after_reversal
                       : switched               ? Stretch::ramp_after_switching
                                                : Stretch::ramp_before_switching;
    }
  }
}

// What would make every comparison meaningless: a sign or a unit that is wrong.
void check_scale(const BenchRecording& r, const Model& model, const SimulationOptions& roughly) {
  const auto simulated = simulate_bench(model, r, roughly);
  for (std::size_t c = 0; c < r.channels.size(); ++c) {
    const auto& m = r.channels[c];
    double sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0, n = 0;
    for (std::size_t i = 0; i < r.time.size(); ++i) {
      if (std::isnan(m.value[i])) continue;
      const double x = simulated[c][i], y = m.value[i];
      sx += x;
      sy += y;
      ++n;
    }
    for (std::size_t i = 0; i < r.time.size(); ++i) {
      if (std::isnan(m.value[i])) continue;
      const double x = simulated[c][i] - sx / n, y = m.value[i] - sy / n;
      sxx += x * x;
      sxy += x * y;
      syy += y * y;
    }
    if (!(sxx > 0) || !(syy > 0)) continue;
    const double correlation = sxy / std::sqrt(sxx * syy), ratio = std::sqrt(syy / sxx);
    if (correlation * correlation < 0.25 || 3 * m.scatter > std::sqrt(syy / n)) continue;
    if (correlation < 0)
      refuse(r.name, path_of(m.channel), "moves against the model: its sign is wrong",
             "turn the channel's sign; field along poling, extension and compressive force are positive");
    if (ratio > 30 || ratio < 1.0 / 30)
      refuse(r.name, path_of(m.channel),
             "is " + std::to_string(ratio) + " times what the model gives: wrong units?", in_si);
  }
}

}  // namespace

std::string_view stretch_name(Stretch stretch) {
  constexpr std::array<std::string_view, stretch_count> names{"rest",
                                                              "hold, early",
                                                              "hold, late",
                                                              "after reversal",
                                                              "ramp, before switching",
                                                              "ramp, switching",
                                                              "ramp, after switching"};
  return names.at(static_cast<std::size_t>(stretch));
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

const MeasuredChannel* BenchRecording::find(Channel channel) const {
  for (const auto& m : channels)
    if (m.channel == channel) return &m;
  return nullptr;
}

std::vector<BenchRecording> prepare(const Model& model, const std::vector<NamedRecording>& recordings,
                                    std::size_t rows, std::vector<std::string>& warnings,
                                    const std::function<bool()>* stop) {
  const SimulationOptions roughly{.tolerance = 1e-3, .stop = stop};
  if (recordings.empty()) throw Error(ErrorCode::invalid_params, "there is no recording to learn from");
  std::set<std::string> names;
  std::vector<BenchRecording> out;
  for (const auto& [name, r] : recordings) {
    check_stop(roughly);
    if (!names.insert(name).second)
      throw Error(ErrorCode::invalid_params, "two recordings have the same name",
                  Problem{.path = "/recordings", .message = "stands here twice", .given = name});
    check_time(name, r);
    check_values(name, r);
    BenchRecording b;
    b.name = name;
    b.header = r.header;
    b.has_command = r.has(Channel::command);
    if (!b.has_command && !r.has(Channel::field))
      refuse(name, "/entry/data", "has neither command nor field");
    set_drive(b, r);
    const auto chosen = choose_rows(r, b.knot_time, std::max<std::size_t>(1000, rows / recordings.size()));
    if (chosen.size() < r.size())
      warnings.push_back(name + ": " + std::to_string(chosen.size()) + " of " + std::to_string(r.size()) +
                         " samples took part, densest after each corner.");
    for (const std::size_t row : chosen) b.time.push_back(r.time[row] - r.time.front());
    add_channels(b, r, chosen, warnings);
    if (b.channels.empty())
      refuse(name, "/entry/data", "has no channel that says anything of the actuator",
             "charge, displacement or force is needed");
    set_stretches(b, model, roughly);
    check_scale(b, model, roughly);
    out.push_back(std::move(b));
  }
  return out;
}

std::vector<std::vector<double>> simulate_bench(const Model& model, const BenchRecording& r,
                                                const SimulationOptions& options,
                                                SimulationStatistics* statistics) {
  std::vector<std::vector<double>> out;
  ChannelSpans spans;
  for (const auto& m : r.channels) {
    auto& column = out.emplace_back(r.time.size());
    switch (m.channel) {
      case Channel::charge:
        spans.charge = column;
        break;
      case Channel::displacement:
        spans.displacement = column;
        break;
      case Channel::force:
        spans.force = column;
        break;
      default:
        spans.field = column;
    }
  }
  const auto took =
      simulate_at(model_for(model, r.header), r.knot_time, r.knot_field, r.time, spans, options);
  if (statistics != nullptr) *statistics = took;
  return out;
}

std::vector<bool> choose_held_out(const std::vector<BenchRecording>& recordings,
                                  const std::set<std::size_t>& never) {
  const std::size_t n = recordings.size();
  std::vector<bool> out(n, false);
  if (n < 3) return out;
  // What a recording can show: its kinds of stretch, its load, and the decade of its duration.
  std::vector<std::set<std::string>> shows(n);
  for (std::size_t i = 0; i < n; ++i) {
    const auto& r = recordings[i];
    std::map<Stretch, std::size_t> counts;
    for (const auto s : r.stretch) ++counts[s];
    for (const auto& [s, count] : counts)
      if (50 * count > r.stretch.size()) shows[i].insert(std::string(stretch_name(s)));
    shows[i].insert("prestress " + std::to_string(std::lround(r.header.load.prestress / 1e5)));
    shows[i].insert("spring " + std::to_string(std::lround(r.header.load.spring_stiffness / 1e4)));
    shows[i].insert("decade " + std::to_string(std::lround(std::log10(r.duration()))));
  }
  const std::size_t take = std::max<std::size_t>(1, n / 4);
  // One after the other, each time the one that is missed least.
  const auto worth = [&](const std::vector<bool>& held) {
    std::map<std::string, int> trained, locked;
    for (std::size_t i = 0; i < n; ++i)
      for (const auto& s : shows[i]) ++(held[i] ? locked : trained)[s];
    // Losing a kind for the training costs more than not proving it.
    double sum = 10 * static_cast<double>(trained.size()) + static_cast<double>(locked.size());
    for (const auto& [s, count] : trained) sum += 0.1 * std::min(count, 3);
    return sum;
  };
  for (std::size_t k = 0; k < take; ++k) {
    std::size_t best = n;
    double most = -1;
    for (std::size_t i = 0; i < n; ++i) {
      if (out[i] || never.contains(i)) continue;
      auto trial = out;
      trial[i] = true;
      if (const double w = worth(trial); w > most) {
        most = w;
        best = i;
      }
    }
    if (best < n) out[best] = true;
  }
  return out;
}

}  // namespace ferrobench::model::discrepancy
