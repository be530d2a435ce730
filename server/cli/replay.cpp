#include <filesystem>
#include <iostream>

#include "base/visible.h"
#include "daq/replay/play.h"
#include "recordings/analysis/statistics.h"
#include "recordings/file/reader.h"
#include "recordings/file/writer.h"
#include "recordings/reports/report.h"
#include "server/cli/link.h"
#include "server/cli/words.h"
#include "server/engine/simulation.h"
#include "server/engine/verify.h"

namespace ferrobench::cli {

using nlohmann::json;
using recordings::Recording;
namespace fs = std::filesystem;

namespace {

struct ReplayOptions {
  std::string recording{}, model{}, past{}, out{}, format = "text", played = "counts";
  double speed = 0;  // 0: not given
  std::optional<double> from{}, to{};
  bool fast = false, verify = false, force = false, quiet = false;
  std::vector<std::string> set{};
};

void demand_sense(const ReplayOptions& o) {
  if (o.verify && (!o.set.empty() || !o.model.empty()))
    throw Error(ErrorCode::invalid_params, "nothing can be identical that is meant to differ",
                Problem{.path = o.set.empty() ? "/model" : "/set",
                        .message = "does not go with --verify",
                        .hint = "leave one of the two out"});
}

server::RunRequest request_of(const ReplayOptions& o, const std::string& path) {
  server::RunRequest request;
  request.device = "replay";
  request.replay_file = path;
  // What is only checked or calculated with need not take its time.
  request.fast = o.fast || (o.speed == 0 && (o.verify || !o.model.empty()));
  const auto settings = set_argument(o.set);
  for (const auto& [key, value] : settings.items()) request.set["device." + key] = value;
  request.set["device.played"] = o.played;
  if (o.speed != 0) request.set["device.speed"] = o.speed;
  if (o.from) request.set["device.from"] = *o.from;
  if (o.to) request.set["device.to"] = *o.to;
  return request;
}

// A folder that is gone afterwards.
struct Scratch {
  Scratch() {
    auto name = (fs::temp_directory_path() / "ferrobench-replay-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr)
      throw Error(ErrorCode::io_error, "there is no room for a temporary folder",
                  Problem{.given = name, .hint = "set TMPDIR to a folder that can be written"});
    path = name;
  }
  ~Scratch() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  fs::path path;
};

// Through the whole machinery of a run, into a file.
int replay_to_file(const ReplayOptions& o, const std::string& path, recordings::Existing existing) {
  const Scratch scratch;
  server::Hub hub;
  server::Engine engine(scratch.path, hub);
  const auto out = o.out.empty() ? (scratch.path / "replay.h5").string() : o.out;
  auto request = request_of(o, path);
  request.existing = existing;
  const Interrupt interrupt;
  const auto status = follow(
      write_json(engine.start(request, out)),
      [&](const std::string& id) { return write_json(engine.status(id)); },
      [&](const std::string& id, const std::string& reason) { engine.abort(id, reason); }, o.quiet);
  if (const int code = tell_end(status); code != exit_ok) return code;
  if (!o.verify) {
    std::cout << out << '\n';
    return exit_ok;
  }
  const auto config = daq::replay_config_from_json(server::make_replay_plan(request, path).device_config);
  const daq::ReplaySource source(recordings::read_recording(path), config);
  const auto replayed = recordings::read_recording(out);
  if (const auto found = server::first_difference(source.recording(), replayed)) {
    std::cout << "differs (recorded and replayed) in " << *found << '\n';
    return exit_error;
  }
  std::cout << "identical: " << replayed.size() << " samples, " << replayed.segments.size() << " segments, "
            << replayed.events.size() << " events, and the report\n";
  return exit_ok;
}

daq::Replay replay_in_memory(const ReplayOptions& o, const std::string& path) {
  const auto plan = server::make_replay_plan(request_of(o, path), path);
  daq::ReplayDevice device(recordings::read_recording(path),
                           daq::replay_config_from_json(plan.device_config));
  const Interrupt interrupt;
  ProgressLine line;
  auto out = daq::play(device, daq::Limits{}, [&](double share) {
    if (!o.quiet) line.show("replaying", std::min(share, 1.0), -1);
    return Interrupt::count() == 0;
  });
  line.finish();
  return out;
}

// The model's answer to the field that was replayed, beside what was measured.
int beside_model(const ReplayOptions& o, const Recording& measured, const std::string& path,
                 recordings::Existing existing, const Common& common) {
  auto model = model_argument(o.model);
  if (model.is_string()) model = server::Store(common.data_folder()).model(o.model);
  const auto simulation = server::simulate_recording(measured, model, path, past_argument(o.past));
  // A sensor's zero is unknown, so the constant part of what the model misses is told apart from the rest.
  std::printf("%-14s %14s %14s %14s %10s %18s\n", "channel", "rms", "mean", "maximum", "rms/range",
              "without the mean");
  for (const auto& c : recordings::compare(measured, simulation.recording).columns) {
    const auto channel = std::ranges::find_if(
        recordings::all_channels, [&](auto each) { return c.dataset == recordings::channel_place(each); });
    if (channel == recordings::all_channels.end() || *channel == recordings::Channel::command) continue;
    if (!c.in_a || !c.in_b) continue;
    const auto& values = measured.at(*channel);
    double low = INFINITY, high = -INFINITY;
    for (const double v : values) {
      low = std::fmin(low, v);
      high = std::fmax(high, v);
    }
    const double percent = high > low ? 100 / (high - low) : 0;
    const auto* unit = c.unit.c_str();
    std::printf("%-14s %10.4g %-3s %10.4g %-3s %10.4g %-3s %8.3f %% %16.3f %%\n",
                std::string(channel_name(*channel)).c_str(), c.rms, unit, c.mean, unit, c.maximum, unit,
                percent * c.rms, percent * c.spread());
  }
  if (o.out.empty()) return exit_ok;
  recordings::write_recording(o.out, simulation.recording, existing);
  std::cout << o.out << '\n';
  return exit_ok;
}

int replay(const ReplayOptions& o, const Common& common) {
  const auto path = recording_argument(o.recording, common);
  demand_sense(o);
  const auto existing = demand_free(o.out, o.force, {path, o.model});
  if (o.verify || (!o.out.empty() && o.model.empty())) return replay_to_file(o, path, existing);
  const auto replayed = replay_in_memory(o, path);
  if (replayed.outcome.end != daq::End::complete) {
    std::cerr << "ferrobench: the replay was stopped: " << visible(replayed.outcome.reason) << '\n';
    return Interrupt::count() > 0 ? exit_interrupted : exit_error;
  }
  if (!o.model.empty()) return beside_model(o, replayed.recording, path, existing, common);
  std::cout << render(recordings::make_report(replayed.recording), recordings::format_from_name(o.format));
  return exit_ok;
}

}  // namespace

void add_replay(CLI::App& app, Common& common) {
  auto* sub = app.add_subcommand("replay", "Run a recording again as it was measured; prints its report");
  auto o = std::make_shared<ReplayOptions>();
  sub->add_option("RECORDING", o->recording, "a file, or the name of a recording in the data folder")
      ->required();
  sub->add_flag(
      "--verify", o->verify,
      "say whether samples, events, segments and report come out identical, or the first difference");
  auto* speed = sub->add_option("--speed", o->speed, "times the recorded speed; default: 1")
                    ->check(number_from(1.0, 1e6));
  sub->add_flag("--fast", o->fast, "as fast as it can go; --verify and --model do so unless --speed is given")
      ->excludes(speed);
  sub->add_option("--from", o->from, "start of the part to play, in s")->check(number_from(0));
  sub->add_option("--to", o->to, "end of the part to play, in s")->check(number_from(0));
  sub->add_option(
         "--set", o->set,
         "change of calibration: CHANNEL.gain, CHANNEL.offset (SI), for field, charge, displacement, "
         "force; again for more")
      ->type_name("KEY=VALUE")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  sub->add_option("--played", o->played,
                  "counts: through the scaling, where there are any; signals: SI values")
      ->check(one_of({"counts", "signals"}))
      ->capture_default_str();
  sub->add_option("--model", o->model,
                  "play the recorded field through this model (name or file) as well: rms of model against "
                  "measurement, by channel");
  add_past(sub, o->past)->needs("--model");
  sub->add_option("--out", o->out, "file of the new recording; with --model, of what the model says")
      ->type_name("OUT.h5");
  sub->add_flag("--force", o->force, "replace the file if it is there, once the new one is whole");
  sub->add_option("--format", o->format, "of the report")
      ->check(one_of({"text", "md", "csv", "json", "html"}))
      ->capture_default_str();
  sub->add_flag("--quiet", o->quiet, "no progress");
  sub->footer(
      "Exit code 1: --verify found a difference. With --model: the mean is of model less measurement.\n"
      "A model starts from rest where the part that is played starts,\n"
      "after the past that --past or the recording names; of a later part it is none.\n"
      "Examples:\n"
      "  ferrobench replay creep.h5 --verify\n"
      "  ferrobench replay creep.h5 --speed 100 --from 10 --to 60\n"
      "  ferrobench replay creep.h5 --fast --set displacement.gain=1.02 --out recalibrated.h5\n"
      "  ferrobench replay creep.h5 --model soft-pzt");
  sub->callback([o, &common] { common.action = [o, &common] { return replay(*o, common); }; });
}

}  // namespace ferrobench::cli
