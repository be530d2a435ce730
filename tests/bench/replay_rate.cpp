// How fast a recording is replayed into its report, beside plain reading of the file.
//
//     ferrobench_replay_rate [ROWS] [FOLDER]
//
// A recording of ROWS rows (10^6) with field, charge, displacement and force as counts is written to FOLDER
// (the temporary one). A sample is one value of one column: ten a row, 10^7 in all. Times are processor times
// of this process and of those that read files for it, as other programs may be running, the least of several
// rounds.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <random>
#include <stdexcept>

#include "daq/replay/play.h"
#include "recordings/file/reader.h"
#include "recordings/file/writer.h"
#include "recordings/reports/report.h"
#include "tests/bench/cpu_time.h"

namespace ferrobench {
namespace {

using recordings::Channel;
using recordings::Recording;

// Triangles of the field, a hysteretic answer, and noise of 1.6 counts.
Recording synthetic(std::size_t rows) {
  constexpr double rate = 1e5, period = 10;  // Hz, s
  Recording r;
  r.header.title = "rate";
  r.header.start_time = "2026-01-01T00:00:00Z";
  r.header.specimen = {"a stack", 0.02, 2.5e-5, 1e-4, 100};
  r.header.device = {{"driver", "test"}, {"sample_rate", rate}};
  auto& raw = r.raw.emplace();
  raw.columns = {{Channel::field, 2e6 / 32768, 0},
                 {Channel::charge, 2e-3 / 32768, 0},
                 {Channel::displacement, 5e-5 / 32768, 0},
                 {Channel::force, 500.0 / 32768, 0}};
  r.time.resize(rows);
  auto& command = r.set(Channel::command);
  command.resize(rows);
  raw.counts.resize(4 * rows);
  std::mt19937_64 generator(1);
  std::normal_distribution<double> noise(0, 1.6);
  for (std::size_t i = 0; i < rows; ++i) {
    r.time[i] = static_cast<double>(i) / rate;
    const double phase = std::fmod(r.time[i], period) / period;
    const double level = phase < 0.5 ? 4 * phase - 1 : 3 - 4 * phase;
    const double branch = std::tanh(6 * (level + (phase < 0.5 ? -0.4 : 0.4)));
    command[i] = 1.5e6 * level;
    const std::array<double, 4> counts{0.75 * level, 0.8 * branch, 0.4 * branch * level,
                                       0.2 + 0.2 * level * branch};
    for (std::size_t c = 0; c < 4; ++c)
      raw.counts[4 * i + c] = static_cast<std::int16_t>(std::floor(32768 * counts[c] + noise(generator)));
  }
  for (std::size_t c = 0; c < 4; ++c) {
    auto& values = r.set(raw.columns[c].channel);
    values.resize(rows);
    for (std::size_t i = 0; i < rows; ++i) values[i] = raw.columns[c].gain * raw.counts[4 * i + c];
  }
  const auto leg = static_cast<std::int64_t>(rate * period / 2);
  for (std::int64_t first = 0; first + 1 < static_cast<std::int64_t>(rows); first += leg) {
    const bool up = first / leg % 2 == 0;
    r.segments.push_back({first, std::min(first + leg, static_cast<std::int64_t>(rows)), "ramp",
                          up ? "up" : "down", up ? 1.5e6 : -1.5e6, 6e6 / period});
  }
  return r;
}

constexpr std::size_t columns = 10;  // time, command, four channels and their counts

struct Times {  // s
  double reading, open, play, report;
  double replay() const { return open + play + report; }
};

Times round(const std::string& path) {
  daq::ReplayConfig config{.file = path};
  config.clock = daq::Clock::fast;
  const double begin = bench::cpu_time();
  recordings::read_recording(path);
  const double read = bench::cpu_time();
  daq::ReplayDevice device(recordings::read_recording(path), config);
  const double opened = bench::cpu_time();
  const auto replay = daq::play(device, daq::Limits{});
  const double played = bench::cpu_time();
  const auto report = recordings::make_report(replay.recording);
  const double reported = bench::cpu_time();
  if (replay.outcome.end != daq::End::complete || replay.recording.size() != device.source().size() ||
      report.tables.empty())
    throw std::runtime_error("the replay is not whole: " + replay.outcome.reason);
  return {read - begin, opened - read, played - opened, reported - played};
}

void measure(std::size_t rows, const std::filesystem::path& folder) {
  const auto path = (folder / "ferrobench_replay_rate.h5").string();
  recordings::write_recording(path, synthetic(rows));
  std::printf("%zu rows, %.0f MB in the file\n", rows,
              static_cast<double>(std::filesystem::file_size(path)) * 1e-6);

  constexpr int rounds = 5;
  auto best = round(path);
  for (int i = 1; i < rounds; ++i) {
    const auto next = round(path);
    const double reading = std::min(best.reading, next.reading);
    if (next.replay() < best.replay()) best = next;
    best.reading = reading;
  }
  std::filesystem::remove(path);
  const auto print = [&](const char* name, double seconds) {
    std::printf("%-24s %8.3f s  %8.2f Mrows/s  %8.1f Msamples/s  %5.2f of plain reading\n", name, seconds,
                static_cast<double>(rows) / seconds * 1e-6,
                static_cast<double>(rows * columns) / seconds * 1e-6, seconds / best.reading);
  };
  print("plain reading", best.reading);
  print("open for replay", best.open);
  print("play (guard, scaling)", best.play);
  print("report", best.report);
  print("open and play", best.open + best.play);
  print("open, play, report", best.replay());
}

}  // namespace
}  // namespace ferrobench

int main(int argc, char** argv) {
  try {
    ferrobench::measure(argc > 1 ? std::stoull(argv[1]) : 1'000'000,
                        argc > 2 ? std::filesystem::path(argv[2]) : std::filesystem::temp_directory_path());
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
