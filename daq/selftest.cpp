#include "daq/selftest.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "daq/guard/guard.h"
#include "daq/scaling.h"
#include "recordings/analysis/statistics.h"

namespace ferrobench::daq {

namespace {

using protocols::Piece;
using protocols::PieceKind;
using recordings::Channel;

constexpr double level = 5e4;                      // V/m
constexpr double margin = 5;                       // standard errors
constexpr double rounding = 1e-9;                  // of a channel in SI, as a share of the level
constexpr double hold_rows = 100, ramp_rows = 10;  // at least

protocols::SampledWaveform waveform(double rate) {
  std::vector<Piece> pieces;
  std::vector<protocols::Segment> segments;
  const auto add = [&](double duration, double from, double to) {
    const double start = pieces.empty() ? 0 : pieces.back().start + pieces.back().duration;
    const bool hold = from == to;
    pieces.push_back({.kind = hold ? PieceKind::hold : PieceKind::ramp,
                      .start = start,
                      .duration = duration,
                      .from = from,
                      .to = to});
    segments.push_back({.kind = hold ? "hold" : "ramp",
                        .label = hold ? "hold" : "ramp",
                        .start = start,
                        .end = start + duration,
                        .level = to,
                        .rate = std::abs(to - from) / duration});
  };
  const double hold = std::max(0.5, hold_rows / rate);   // s
  const double ramp = std::max(0.25, ramp_rows / rate);  // s
  add(hold, 0, 0);
  add(ramp, 0, level);
  add(hold, level, level);
  add(ramp, level, 0);
  add(hold, 0, 0);
  return {protocols::Waveform(std::move(pieces), std::move(segments)), rate};
}

struct Measured {
  std::size_t rows = 0;
  std::array<std::vector<double>, 5> channels;  // SI, by Channel
  double seconds = 0;
};

void play(Guard& guard, Scaling& scaling, protocols::SampledWaveform program,
          const std::function<std::string()>& stop_wanted, Measured& out) {
  guard.go_to(program.value(0), guard.limits().stop_slew);
  const auto begin = std::chrono::steady_clock::now();
  guard.start(std::move(program));
  std::string stopped;
  for (SampleBlock block; guard.read(block);) {
    if (stop_wanted && stopped.empty())
      if (stopped = stop_wanted(); !stopped.empty()) guard.stop(stopped);
    const auto rows = scaling.rows(block);
    out.rows += block.rows;
    for (std::size_t c = 0; c < out.channels.size(); ++c)
      out.channels.at(c).insert(out.channels.at(c).end(), rows.channels.at(c).begin(),
                                rows.channels.at(c).end());
    out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }
  if (!stopped.empty()) throw Error(ErrorCode::cancelled, "the self-test was stopped: " + stopped);
  if (const auto outcome = guard.outcome(); outcome.end != End::complete)
    throw Error(ErrorCode::device_lost, "the self-test did not come to its end: " + outcome.reason);
}

Measured measure(Device& device, Scaling& scaling, protocols::SampledWaveform program,
                 const std::function<std::string()>& stop_wanted) {
  Limits limits;
  limits.field_min = -2 * level;
  limits.field_max = 2 * level;
  Guard guard(device, limits);
  Measured out;
  const auto told = [&](ErrorCode code, const std::string& what, const std::vector<Problem>& problems) {
    guard.release();
    const auto outcome = guard.outcome();
    return Error(code, outcome.output_at_zero ? what : what + "; " + outcome.warning, problems);
  };
  try {
    play(guard, scaling, std::move(program), stop_wanted, out);
  } catch (const Error& failure) {
    throw told(failure.code(), failure.message(), failure.problems());
  } catch (const std::exception& failure) {
    throw told(ErrorCode::device_lost, failure.what(), {});
  }
  return out;
}

// From third differences, which no drift of the specimen disturbs: their variance is 20 times the noise's.
// The median over parts, so that a domain that switches now and then does not count; its standard error
// is 1.9 times that of a standard deviation of independent values. Of many rows the parts are longer: the
// median of short ones is low by more than that.
double noise_of(const std::vector<double>& values, std::size_t from, std::size_t to) {
  const std::size_t part = std::max<std::size_t>(25, (to - from) / 15);
  std::vector<double> variances;
  for (std::size_t begin = from + 3; begin + part <= to; begin += part) {
    double sum = 0;
    for (std::size_t i = begin; i < begin + part; ++i) {
      const double d = values[i] - 3 * values[i - 1] + 3 * values[i - 2] - values[i - 3];
      sum += d * d;
    }
    variances.push_back(sum / (20 * static_cast<double>(part)));
  }
  return std::sqrt(recordings::median(std::move(variances)));
}

double mean(const std::vector<double>& values, std::size_t from, std::size_t to) {
  double sum = 0;
  for (std::size_t i = from; i < to; ++i) sum += values[i];
  return sum / static_cast<double>(to - from);
}

}  // namespace

SelftestReport selftest(Device& device, double rate, const std::function<std::string()>& stop_wanted) {
  if (!device.measures())
    throw Error(ErrorCode::bad_state, "a replay cannot be tested: it has only the answers that were recorded",
                Problem{.path = "/device", .hint = "test the device that the recording was made with"});
  const auto columns = device.columns();
  rate = device.scan_rate(rate);
  Scaling scaling(columns, device.signals(), rate);
  if (std::ranges::find(scaling.channels(), Channel::field) == scaling.channels().end())
    throw Error(ErrorCode::bad_state, "the self-test needs the field channel",
                Problem{.hint = "enable the field channel"});
  const auto program = waveform(rate);
  const auto corners = std::vector<std::uint64_t>(program.corners().begin(), program.corners().end());
  const auto size = static_cast<double>(program.size());
  const auto measured = measure(device, scaling, program, stop_wanted);

  SelftestReport report{.passed = true, .sample_rate = rate, .rows = {}};
  // Written so that a NaN fails.
  const auto add = [&report](std::string quantity, double value, double lowest, double highest,
                             std::string unit) {
    const bool passed = value >= lowest && value <= highest;
    report.rows.push_back({std::move(quantity), value, lowest, highest, std::move(unit), passed});
    report.passed &= passed;
  };
  add("rows", static_cast<double>(measured.rows), size, size, "");
  if (measured.rows != program.size()) return report;
  if (device.info().value("clock", "real") == "real")
    add("rate", size / measured.seconds, 0.8 * rate, 1.05 * rate, "Hz");

  const auto noise = device.noise();
  // What a count is worth; nothing for a channel that comes in SI.
  const auto count_of = [&](Channel channel) {
    const auto column = std::ranges::find(columns, channel, &recordings::RawColumn::channel);
    return column == columns.end() ? 0 : std::abs(column->gain);
  };
  // A virgin specimen relaxes first.
  const std::uint64_t quiet = corners[0] + (corners[1] - corners[0]) / 4;
  const auto& monitor = measured.channels[static_cast<std::size_t>(Channel::field)];
  const double rest = mean(monitor, corners[0], corners[1]);
  const double top = mean(monitor, corners[2] + 1, corners[3]);
  const double count = count_of(Channel::field);
  const double scatter = noise[static_cast<std::size_t>(Channel::field)].value_or(
      std::max(count, noise_of(monitor, quiet, corners[1])));
  const auto rows = static_cast<double>(corners[1] - corners[0]);
  const double error = margin * scatter / std::sqrt(rows) + count + rounding * level;
  add("monitor offset", rest, -error, error, "V/m");
  add("monitor gain", (top - rest) / level, 0.99 - error / level, 1.01 + error / level, "1");

  for (const auto channel : scaling.channels()) {
    const auto stated = noise[static_cast<std::size_t>(channel)];
    if (!stated || channel == Channel::command) continue;
    // Rounding to counts adds its own variance, if the noise is large enough to
    // spread over some of them.
    const double expected = std::hypot(*stated, count_of(channel) / std::sqrt(12.0));
    const double spread = margin * 1.9 / std::sqrt(2 * static_cast<double>(corners[1] - quiet));
    const double lowest = *stated > count_of(channel) / 2 ? expected * std::max(0.0, 1 - spread) : 0;
    add(std::string(recordings::channel_name(channel)) + " noise",
        noise_of(measured.channels[static_cast<std::size_t>(channel)], quiet, corners[1]), lowest,
        expected * (1 + spread), std::string(recordings::channel_unit(channel)));
  }
  return report;
}

}  // namespace ferrobench::daq
