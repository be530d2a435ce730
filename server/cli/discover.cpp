#include "model/discrepancy/discover.h"

#include <filesystem>
#include <iostream>

#include "model/discrepancy/report.h"
#include "recordings/file.h"
#include "server/cli/link.h"
#include "server/engine/simulation.h"

namespace ferrobench::cli {

namespace {

struct DiscoverCommand {
  std::vector<std::string> recordings{}, held_out{}, tables{};
  std::string model{}, json{}, report{}, improved{};
  int threads = 0;
  std::uint64_t seed = 1;
};

std::vector<std::string> split_names(const std::vector<std::string>& given) {
  std::vector<std::string> out;
  for (const auto& text : given)
    for (std::size_t begin = 0; begin <= text.size();) {
      const auto end = std::min(text.find(',', begin), text.size());
      if (end > begin) out.push_back(text.substr(begin, end - begin));
      begin = end + 1;
    }
  return out;
}

// A recording goes by its file's name, with or without the ending.
std::string name_of(const std::string& given) {
  const auto name = std::filesystem::path(given).filename();
  return name.extension() == ".h5" ? name.stem().string() : name.string();
}

int discover(const DiscoverCommand& o, const Common& common) {
  const auto base = model::model_from_json(
      server::resolve_model(model_argument(o.model), server::Store(common.data_folder())));
  std::vector<model::NamedRecording> recordings;
  for (const auto& given : o.recordings)
    recordings.push_back({name_of(given), recordings::read_recording(recording_argument(given, common))});

  if (recordings.empty() == o.tables.empty())
    throw Error(ErrorCode::invalid_params,
                "discover wants recordings, or published tables by --table, not both");

  const Interrupt interrupt;
  ProgressLine line;
  const auto begin = std::chrono::steady_clock::now();
  model::DiscoverOptions options;
  for (const auto& given : split_names(o.held_out)) options.held_out.push_back(name_of(given));
  options.threads = o.threads;
  options.seed = o.seed;
  options.progress = [&](const model::DiscoverProgress& p) {
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
    line.show(p.stage, p.fraction, p.fraction > 0.02 ? spent.count() * (1 - p.fraction) / p.fraction : -1);
    return Interrupt::count() == 0;
  };
  model::Discovery found;
  try {
    found = o.tables.empty() ? model::discover(base, std::move(recordings), options)
                             : model::discover_in_tables(base, o.tables, options);
  } catch (const Error& e) {
    line.finish();
    if (e.code() != ErrorCode::cancelled) throw;
    std::cerr << "ferrobench: stopped; nothing was written\n";
    return exit_interrupted;
  }
  line.finish();
  if (!o.json.empty()) write_output(o.json == "-" ? "" : o.json, to_json(found).dump(2) + "\n");
  if (!o.report.empty()) write_output(o.report, html_report(found));
  if (!o.improved.empty()) write_output(o.improved, to_json(found.improved).dump(2) + "\n");
  if (o.json != "-") write_output("", text_report(found));
  return exit_ok;
}

}  // namespace

void add_discover(CLI::App& app, Common& common) {
  auto* sub = app.add_subcommand(
      "discover", "Find what a model misses in recordings, name it, add it, and prove it on unseen ones");
  auto o = std::make_shared<DiscoverCommand>();
  sub->add_option("RECORDING", o->recordings,
                  "files, or names in the data folder; eight of different kinds are good");
  sub->add_option("--table", o->tables,
                  "a published table for a bench, in place of recordings: 3.10 ... 3.13")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  sub->add_option("--model", o->model, "the model in question, by name or file")->required();
  sub->add_option(
         "--held-out", o->held_out,
         "recordings to lock away for the proof, by name; default: about a quarter, chosen so that every "
         "kind of segment stays on both sides")
      ->type_name("NAME,...")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  sub->add_option("--json", o->json, "file of the whole result; - for standard output")
      ->type_name("OUT.json");
  sub->add_option("--report", o->report, "file of the report, a page with pictures")->type_name("OUT.html");
  sub->add_option("--improved", o->improved, "file of the improved model")->type_name("OUT-MODEL.json");
  sub->add_option("--threads", o->threads, "0: as many as the machine has")
      ->check(CLI::Range(0, 256))
      ->capture_default_str();
  sub->add_option("--seed", o->seed, "of the recalibration's other starts")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  sub->footer(
      "Prints the findings. Ctrl-C stops it; nothing is written then.\n"
      "Examples:\n"
      "  ferrobench discover --model nec-ae0505d08 *.h5 --report missing.html --improved better.json\n"
      "  ferrobench discover --model nec-single-crystal --table 3.11 --table 3.12\n"
      "  ferrobench discover --model mine.json --held-out loop-3,creep-2 *.h5 --json found.json");
  sub->callback([o, &common] { common.action = [o, &common] { return discover(*o, common); }; });
}

}  // namespace ferrobench::cli
