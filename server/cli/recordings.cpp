#include <cstdio>
#include <iostream>
#include <sstream>

#include "base/visible.h"
#include "recordings/exchange/export.h"
#include "recordings/file/reader.h"
#include "recordings/file/writer.h"
#include "recordings/journal/writer.h"
#include "recordings/reports/report.h"
#include "server/cli/link.h"
#include "server/cli/words.h"
#include "server/engine/simulation.h"

namespace ferrobench::cli {

using nlohmann::json;

namespace {

const std::vector<std::string> formats{"text", "md", "csv", "json", "html"};

struct RecordingOptions {
  std::string recording{}, format{}, out{}, model{}, past{};
};

CLI::Option* add_recording(CLI::App* sub, RecordingOptions& o) {
  return sub->add_option("RECORDING", o.recording, "a file, or the name of a recording in the data folder")
      ->required();
}

int list(const RecordingOptions& o, const Common& common) {
  const auto recordings = Link(common).call("recording.list").at("recordings");
  if (o.format == "json") {
    std::cout << recordings.dump(2) << '\n';
    return exit_ok;
  }
  if (recordings.empty()) std::cerr << "no recordings yet: ferrobench run PROTOCOL makes one\n";
  for (const auto& r : recordings)
    std::printf("%-52s %-10s %9.1f s %9lld rows  %s\n", r.at("name").get<std::string>().c_str(),
                visible(r.at("status").get<std::string>()).c_str(), r.at("duration_s").get<double>(),
                static_cast<long long>(r.at("rows").get<std::int64_t>()),
                visible(r.at("title").get<std::string>()).c_str());
  return exit_ok;
}

std::vector<std::string> sources_of(const std::string& recording) {
  return {recording, recordings::journal_path(recording)};
}

int report(const RecordingOptions& o, const Common& common) {
  const auto path = recording_argument(o.recording, common);
  const TextOutput out(o.out, sources_of(path));
  const auto recording = recordings::read_recording(path);
  out.write(render(recordings::make_report(recording), recordings::format_from_name(o.format)));
  return exit_ok;
}

int simulate(const RecordingOptions& o, const Common& common) {
  const auto path = recording_argument(o.recording, common);
  demand_free(o.out, true, {path, o.model});
  auto model = model_argument(o.model);
  if (model.is_string()) model = server::Store(common.data_folder()).model(o.model);
  const auto simulation =
      server::simulate_recording(recordings::read_recording(path), model, path, past_argument(o.past));
  recordings::write_recording(o.out, simulation.recording);
  (void)std::fprintf(
      stderr,
      "%zu samples simulated. Estimated errors: from steps in time %.1e of the switching range "
      "(rms), from the domain quadrature %.1e of the signal's range (rms).\n",
      simulation.recording.size(), simulation.time_error, simulation.quadrature_error);
  std::cout << o.out << '\n';
  return exit_ok;
}

int export_samples(const RecordingOptions& o, const Common& common) {
  const auto path = recording_argument(o.recording, common);
  const TextOutput out(o.out, sources_of(path));
  const auto recording = recordings::read_recording(path);
  std::ostringstream text;
  o.format == "csv" ? export_csv(recording, text) : export_json(recording, text);
  out.write(text.str());
  return exit_ok;
}

template <class F>
void act(CLI::App* sub, const std::shared_ptr<RecordingOptions>& o, Common& common, F function) {
  sub->callback(
      [o, &common, function] { common.action = [o, &common, function] { return function(*o, common); }; });
}

}  // namespace

void add_list(CLI::App& app, Common& common) {
  auto* sub =
      app.add_subcommand("list", "List the recordings of the data folder, newest first, with their status");
  auto o = std::make_shared<RecordingOptions>();
  sub->add_option("--format", o->format, "text or json")
      ->check(one_of({"text", "json"}))
      ->default_val("text");
  sub->footer(
      "Status: running, broken_off (its program ended; 'ferrobench recover' makes the file), complete, "
      "aborted,\n"
      "recovered (broken off, and its file made) or unreadable.\n"
      "Example:\n  ferrobench list --format json");
  act(sub, o, common, list);
}

void add_report(CLI::App& app, Common& common) {
  auto* sub = app.add_subcommand("report",
                                 "Report a recording: stroke, hysteresis, creep, rates, minor loops, pulses, "
                                 "small-signal response");
  auto o = std::make_shared<RecordingOptions>();
  add_recording(sub, *o);
  sub->add_option("--format", o->format, "of the report")->check(one_of(formats))->default_val("text");
  sub->add_option("--out", o->out, "default: standard output")->type_name("FILE");
  sub->footer("Example:\n  ferrobench report creep.h5 --format html --out creep.html");
  act(sub, o, common, report);
}

void add_simulate(CLI::App& app, Common& common) {
  auto* sub = app.add_subcommand(
      "simulate",
      "Play a recording's own field program through a model, without noise, into a new recording");
  auto o = std::make_shared<RecordingOptions>();
  add_recording(sub, *o);
  sub->add_option("--model", o->model, "by name or file; default: the recording's own");
  add_past(sub, o->past);
  sub->add_option("--out", o->out, "file of the new recording; replaced if it is there")
      ->type_name("OUT.h5")
      ->required();
  sub->footer(
      "The recording's specimen and load win over the model's own.\n"
      "Examples:\n"
      "  ferrobench simulate creep.h5 --model nec-ae0505d08 --out simulated.h5\n"
      "  ferrobench simulate loop.h5 --model mine.json --past poled_minus --out simulated.h5");
  act(sub, o, common, simulate);
}

void add_export(CLI::App& app, Common& common) {
  auto* sub = app.add_subcommand("export", "Write a recording's samples as CSV or JSON, in SI units");
  auto o = std::make_shared<RecordingOptions>();
  add_recording(sub, *o);
  sub->add_option("--format", o->format, "csv: the samples; json: with specimen, load, segments and events")
      ->check(one_of({"csv", "json"}))
      ->default_val("csv");
  sub->add_option("--out", o->out, "default: standard output")->type_name("FILE");
  sub->footer("Example:\n  ferrobench export creep.h5 --out creep.csv");
  act(sub, o, common, export_samples);
}

}  // namespace ferrobench::cli
