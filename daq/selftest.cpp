#include "daq/selftest.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "daq/guard/guard.h"
#include "recordings/statistics.h"

namespace ferrobench::daq {

namespace {

using protocols::Piece;
using protocols::PieceKind;
using recordings::Channel;

constexpr double level = 5e4;  // V/m
constexpr double rate = 1000;  // rows/s
constexpr double margin = 5;   // standard errors

protocols::SampledWaveform waveform() {
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
  add(0.5, 0, 0);
  add(0.25, 0, level);
  add(0.5, level, level);
  add(0.25, level, 0);
  add(0.5, 0, 0);
  return {protocols::Waveform(std::move(pieces), std::move(segments)), rate};
}

struct Measured {
  std::vector<double> command;
  std::vector<std::vector<double>> columns;  // SI
  double seconds = 0;
};

Measured measure(Device& device, const std::vector<recordings::RawColumn>& columns,
                 protocols::SampledWaveform program, const std::function<std::string()>& stop_wanted) {
  Limits limits;
  limits.field_min = -2 * level;
  limits.field_max = 2 * level;
  Guard guard(device, limits);
  guard.go_to(program.value(0), limits.stop_slew);
  Measured out;
  out.columns.resize(columns.size());
  const auto begin = std::chrono::steady_clock::now();
  guard.start(std::move(program));
  std::string stopped;
  for (SampleBlock block; guard.read(block);) {
    if (stop_wanted && stopped.empty())
      if (stopped = stop_wanted(); !stopped.empty()) guard.stop(stopped);
    out.command.insert(out.command.end(), block.command.begin(), block.command.end());
    for (std::size_t i = 0; i < block.counts.size(); ++i) {
      const auto& column = columns[i % columns.size()];
      out.columns[i % columns.size()].push_back(column.offset + column.gain * block.counts[i]);
    }
    out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }
  if (!stopped.empty()) throw Error(ErrorCode::cancelled, "the self-test was stopped: " + stopped);
  if (const auto outcome = guard.outcome(); outcome.end != End::complete)
    throw Error(ErrorCode::device_lost, "the self-test did not come to its end: " + outcome.reason);
  return out;
}

// From third differences, which no drift of the specimen disturbs: their variance is 20 times the noise's.
// The median over parts, so that a domain that switches now and then does not count; its standard error
// is 1.9 times that of a standard deviation of independent values.
double noise_of(const std::vector<double>& values, std::size_t from, std::size_t to) {
  constexpr std::size_t part = 25;
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

bool SelftestReport::passed() const {
  return std::all_of(rows.begin(), rows.end(), [](const auto& row) { return row.passed(); });
}

nlohmann::json to_json(const SelftestReport& report) {
  nlohmann::json rows = nlohmann::json::array();
  for (const auto& r : report.rows)
    rows.push_back({{"quantity", r.quantity},
                    {"measured", r.measured},
                    {"lowest", r.lowest},
                    {"highest", r.highest},
                    {"unit", r.unit},
                    {"passed", r.passed()}});
  return {{"passed", report.passed()}, {"rows", std::move(rows)}};
}

SelftestReport selftest(Device& device, const std::function<std::string()>& stop_wanted) {
  const auto columns = device.columns();
  const auto field =
      std::find_if(columns.begin(), columns.end(), [](auto& c) { return c.channel == Channel::field; });
  if (field == columns.end())
    throw Error(ErrorCode::bad_state, "the self-test needs a field column",
                Problem{.hint = "enable the field channel"});
  const auto program = waveform();
  const auto corners = std::vector<std::uint64_t>(program.corners().begin(), program.corners().end());
  const auto size = static_cast<double>(program.size());
  const auto measured = measure(device, columns, program, stop_wanted);

  SelftestReport report;
  report.rows.push_back({"rows", static_cast<double>(measured.command.size()), size, size, ""});
  if (measured.command.size() != program.size()) return report;
  if (device.info().value("clock", "real") == "real")
    report.rows.push_back({"rate", size / measured.seconds, 0.8 * rate, 1.05 * rate, "Hz"});

  const auto noise = device.noise();
  // A virgin specimen relaxes first.
  const std::uint64_t quiet = corners[0] + (corners[1] - corners[0]) / 4;
  const auto& monitor = measured.columns[static_cast<std::size_t>(field - columns.begin())];
  const double rest = mean(monitor, corners[0], corners[1]);
  const double top = mean(monitor, corners[2] + 1, corners[3]);
  const double count = std::abs(field->gain);
  const double error =
      margin * noise[static_cast<std::size_t>(Channel::field)].value_or(count) / std::sqrt(0.5 * rate) +
      count;
  report.rows.push_back({"monitor offset", rest, -error, error, "V/m"});
  report.rows.push_back(
      {"monitor gain", (top - rest) / level, 0.99 - error / level, 1.01 + error / level, "1"});

  for (std::size_t i = 0; i < columns.size(); ++i) {
    const auto channel = columns[i].channel;
    const auto stated = noise[static_cast<std::size_t>(channel)];
    if (!stated) continue;
    // Rounding to counts adds its own variance, if the noise is large enough to spread over some of them.
    const double expected = std::hypot(*stated, columns[i].gain / std::sqrt(12.0));
    const double spread = margin * 1.9 / std::sqrt(2 * static_cast<double>(corners[1] - quiet));
    const double lowest = *stated > std::abs(columns[i].gain) / 2 ? expected * (1 - spread) : 0;
    report.rows.push_back({std::string(recordings::channel_name(channel)) + " noise",
                           noise_of(measured.columns[i], quiet, corners[1]), lowest, expected * (1 + spread),
                           std::string(recordings::channel_unit(channel))});
  }
  return report;
}

}  // namespace ferrobench::daq
