#include "model/inference/dataset/bench.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "model/inference/dataset/drive.h"
#include "model/inference/dataset/refusal.h"
#include "model/on_recording.h"
#include "recordings/analysis/statistics.h"

namespace ferrobench::model::inference {
namespace {

using recordings::Channel;
using recordings::Recording;

constexpr const char* in_si = "every channel is in SI units: V/m, C, m, N";
constexpr double most_measured = 1e15;  // in SI units: whose squares can still be summed, by far

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
        refuse(name, channel_path(channel), fmt::format("holds {:.3g}, which nothing measures", v),
               std::string("it may be damaged; ") + in_si);
  }
}

// Quiet windows of a channel that are enough to know its noise: more than there are in what is compared
// whole.
constexpr std::size_t most_quiet_windows = 500;

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
    m.quiet = {r.time, all, m.scatter, most_quiet_windows};
    m.zeroed =
        channel == Channel::charge && r.header.charge_reference == recordings::ChargeReference::first_sample;
    for (const std::size_t row : rows) m.value.push_back(std::isfinite(all[row]) ? all[row] : NAN);
    out.channels.push_back(std::move(m));
  }
}

// Whether a channel goes the other way than the model from each of some 50 pieces of a recording to the next.
// What drifts is taken out by the mean change: a force whose prestress relaxes falls all the time, whatever
// the specimen does.
bool goes_against(const std::vector<double>& simulated, const std::vector<double>& measured) {
  constexpr std::size_t pieces = 50;
  const std::size_t step = std::max<std::size_t>(1, measured.size() / pieces);
  double sx = 0, sy = 0, sxy = 0, n = 0;
  for (std::size_t i = step; i < measured.size(); i += step) {
    const double x = simulated[i] - simulated[i - step], y = measured[i] - measured[i - step];
    if (std::isnan(y)) continue;
    sx += x;
    sy += y;
    sxy += x * y;
    ++n;
  }
  return n > 0 && sxy - sx * sy / n < 0;
}

// How a channel of a recording moves, where that shows at all.
struct Movement {
  std::string recording;
  Channel channel = Channel::charge;
  double correlation = 0;  // with what the model gives
  bool against = false;    // against the model, by its correlation and from piece to piece (goes_against)
};

// A unit that is wrong makes every comparison meaningless. Adds how each channel moves.
void check_scale(const BenchRecording& r, const Model& model, const SimulationOptions& roughly,
                 std::vector<Movement>& movements) {
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
    // A specimen that was poled the other way, or half of it, moves the other way as well.
    const auto& past = r.header.past;
    movements.push_back({r.name, m.channel, correlation,
                         correlation < 0 && (!past.known() || past.kind == protocols::PastKind::poled_plus) &&
                             goes_against(simulated[c], m.value)});
    if (ratio > 30 || ratio < 1.0 / 30)
      refuse(r.name, channel_path(m.channel),
             "is " + std::to_string(ratio) + " times what the model gives: wrong units?", in_si);
  }
}

// A wrong sign makes every comparison meaningless, too. A channel that moves against the model in one
// recording and with it in others has the right sign, unless it mirrors there what the model gives: a spring
// that softens much pulls less the further it is stretched.
void check_signs(const std::vector<Movement>& movements, std::vector<std::string>& warnings) {
  constexpr double mirrored = 0.9;  // of the correlation; what turns back has less
  for (const auto& m : movements) {
    if (!m.against) continue;
    const bool elsewhere_with = std::ranges::any_of(
        movements, [&](const Movement& o) { return o.channel == m.channel && o.correlation > 0; });
    if (!elsewhere_with || m.correlation < -mirrored)
      refuse(m.recording, channel_path(m.channel), "moves against the model: its sign is wrong",
             "turn the channel's sign; field along poling, extension and compressive force are positive");
    warnings.push_back(
        fmt::format("{}: {} moves against the model, and with it in other recordings. Its sign is "
                    "wrong here, or something makes it turn back.",
                    m.recording, channel_name(m.channel)));
  }
}

}  // namespace

const MeasuredChannel* BenchRecording::find(Channel channel) const {
  for (const auto& m : channels)
    if (m.channel == channel) return &m;
  return nullptr;
}

bool offset_is_free(const BenchRecording& recording, const MeasuredChannel& measured) {
  const auto& past = recording.header.past;
  return measured.zeroed ||
         (measured.channel != Channel::field && past.known() && past.kind != protocols::PastKind::poled_plus);
}

void check_recordings(const std::vector<NamedRecording>& recordings) {
  if (recordings.empty()) throw Error(ErrorCode::invalid_params, "there is no recording to learn from");
  std::set<std::string> names;
  for (const auto& [name, r] : recordings) {
    if (!names.insert(name).second)
      throw Error(ErrorCode::invalid_params, "two recordings have the same name",
                  Problem{.path = "/recordings", .message = "stands here twice", .given = name});
    check_time(name, r);
    check_values(name, r);
    if (!r.has(Channel::command) && !r.has(Channel::field))
      refuse(name, "/entry/data", "has neither command nor field");
  }
}

std::vector<BenchRecording> prepare_bench(const Model& model, const std::vector<NamedRecording>& recordings,
                                          std::size_t rows, std::vector<std::string>& warnings,
                                          const std::function<bool()>* stop) {
  const SimulationOptions roughly{.tolerance = 1e-3, .stop = stop};
  check_recordings(recordings);
  std::vector<BenchRecording> out;
  std::vector<Movement> movements;
  for (const auto& [name, r] : recordings) {
    check_stop(roughly);
    BenchRecording b;
    b.name = name;
    b.header = r.header;
    b.has_command = r.has(Channel::command);
    set_drive(b, r);
    const auto chosen = choose_rows(r, b.knot_time, std::max<std::size_t>(1000, rows / recordings.size()));
    if (chosen.size() < r.size())
      warnings.push_back(name + ": " + std::to_string(chosen.size()) + " of " + std::to_string(r.size()) +
                         " samples took part, densest after each corner.");
    b.sampling_interval = (r.time.back() - r.time.front()) / static_cast<double>(r.size() - 1);
    for (const std::size_t row : chosen) b.time.push_back(r.time[row] - r.time.front());
    add_channels(b, r, chosen, warnings);
    if (b.channels.empty())
      refuse(name, "/entry/data", "has no channel that says anything of the actuator",
             "charge, displacement or force is needed");
    classify_segments(b, model, roughly);
    check_scale(b, model, roughly, movements);
    out.push_back(std::move(b));
  }
  check_signs(movements, warnings);
  return out;
}

namespace {

// Room for each of the recording's channels, and `spans` over it.
template <class Spans>
std::vector<std::vector<double>> room_for(const BenchRecording& r, std::size_t each, Spans& spans) {
  std::vector<std::vector<double>> out;
  for (const auto& m : r.channels) {
    auto& column = out.emplace_back(each);
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
  return out;
}

SimulationOptions after_past(const BenchRecording& r, SimulationOptions options) {
  options.past = &r.header.past;
  return options;
}

}  // namespace

std::vector<std::vector<double>> simulate_bench(const Model& model, const BenchRecording& r,
                                                const SimulationOptions& options,
                                                SimulationStatistics* statistics) {
  return std::move(simulate_bench(std::span(&model, 1), r, options, statistics).front());
}

std::vector<std::vector<std::vector<double>>> simulate_bench(std::span<const Model> models,
                                                             const BenchRecording& r,
                                                             const SimulationOptions& options,
                                                             SimulationStatistics* statistics) {
  std::vector<std::vector<std::vector<double>>> out;
  std::vector<ChannelSpans> spans(models.size());
  std::vector<Model> here;
  for (std::size_t i = 0; i < models.size(); ++i) {
    here.push_back(model_for(models[i], r.header));
    out.push_back(room_for(r, r.time.size(), spans[i]));
  }
  const auto took = simulate_alike(here, r.knot_time, r.knot_field, r.time, spans, after_past(r, options));
  if (statistics != nullptr) *statistics = took;
  return out;
}

BenchSlopes simulate_bench_with_slopes(const Model& model, const BenchRecording& r,
                                       std::span<const std::string> numbers,
                                       const DriveDirections& directions, const SimulationOptions& options) {
  ChannelSpans spans;
  SlopeSpans slope_spans;
  BenchSlopes out{room_for(r, r.time.size(), spans),
                  room_for(r, r.time.size() * (numbers.size() + directions.count), slope_spans)};
  simulate_with_slopes(model_for(model, r.header), numbers, r.knot_time, r.knot_field, r.time, spans,
                       slope_spans, after_past(r, options), directions);
  return out;
}

}  // namespace ferrobench::model::inference
