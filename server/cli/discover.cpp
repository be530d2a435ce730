#include "model/inference/study/discover.h"

#include <filesystem>
#include <iostream>

#include "model/inference/report/discovery_report.h"
#include "recordings/file/reader.h"
#include "recordings/tables/published.h"
#include "server/cli/link.h"
#include "server/cli/words.h"
#include "server/engine/simulation.h"

namespace ferrobench::cli {

namespace {

struct DiscoverCommand {
  std::vector<std::string> recordings{}, held_out{}, tables{};
  std::string model{}, json{}, report{}, improved{};
  int threads = 0;
  std::uint64_t seed = 1;
  double floor = model::DiscoverOptions{}.floor;
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

// What is made of a finding, each as text; as the job of a daemon gives them.
struct Findings {
  nlohmann::json discovery{};
  std::string html{}, text{};
};

std::vector<std::string> held_out(const DiscoverCommand& o) {
  std::vector<std::string> out;
  for (const auto& given : split_names(o.held_out)) out.push_back(name_of(given));
  return out;
}

// Nothing if it was cancelled.
std::optional<Findings> discover_there(const DiscoverCommand& o, const std::vector<std::string>& names,
                                       server::Client& daemon) {
  const auto status = carry_out_job(daemon, "discrepancy.start",
                                    {{"recordings", names},
                                     {"tables", o.tables},
                                     {"held_out", held_out(o)},
                                     {"model", model_argument(o.model)},
                                     {"seed", o.seed},
                                     {"floor", o.floor},
                                     {"threads", o.threads}});
  const auto& result = status.at("result");
  if (result.is_null()) return std::nullopt;
  return Findings{result.at("discovery"), result.at("html"), result.at("text")};
}

// Of files, in this process: no daemon reads a file by its path.
std::optional<Findings> discover_here(const DiscoverCommand& o, const Common& common) {
  const auto base = model::model_from_json(
      server::resolve_model(model_argument(o.model), server::Store(common.data_folder())));
  std::vector<model::NamedRecording> recordings;
  for (const auto& given : o.recordings)
    recordings.push_back({name_of(given), recordings::read_recording(recording_argument(given, common))});

  const Interrupt interrupt;
  ProgressLine line;
  const auto begin = std::chrono::steady_clock::now();
  model::DiscoverOptions options;
  options.held_out = held_out(o);
  options.threads = o.threads;
  options.seed = o.seed;
  options.floor = o.floor;
  options.progress = [&](const model::DiscoverProgress& p) {
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
    line.show(p.stage, p.fraction, p.fraction > 0.02 ? spent.count() * (1 - p.fraction) / p.fraction : -1);
    return Interrupt::count() == 0;
  };
  options.stop = [] { return Interrupt::count() > 0; };
  try {
    const auto found = o.tables.empty() ? model::discover(base, std::move(recordings), options)
                                        : model::discover_in_tables(base, o.tables, options);
    line.finish();
    return Findings{to_json(found), html_report(found), text_report(found)};
  } catch (const Error& e) {
    line.finish();
    if (e.code() != ErrorCode::cancelled) throw;
    return std::nullopt;
  }
}

int discover(const DiscoverCommand& o, const Common& common) {
  if (o.recordings.empty() && o.tables.empty())
    throw Error(ErrorCode::invalid_params,
                "discover wants recordings to look in, or published tables by --table; none was given");
  if (!o.recordings.empty() && !o.tables.empty())
    throw Error(ErrorCode::invalid_params,
                "discover takes recordings, or published tables by --table, not both");
  std::vector<std::string> sources{o.model};
  for (const auto& given : o.recordings) sources.push_back(recording_argument(given, common));
  const TextOutput json(o.json, sources), report(o.report, sources), improved(o.improved, sources);
  const auto names = names_in_store(o.recordings, common);
  auto daemon = names ? running_daemon(common) : std::nullopt;
  const auto found = daemon ? discover_there(o, *names, *daemon) : discover_here(o, common);
  if (!found) return tell_stopped();
  if (!o.json.empty()) json.write(found->discovery.dump(2) + "\n");
  if (!o.report.empty()) report.write(found->html);
  if (!o.improved.empty()) improved.write(found->discovery.at("model").dump(2) + "\n");
  if (o.json != "-") TextOutput("").write(found->text);
  return exit_ok;
}

}  // namespace

void add_discover(CLI::App& app, Common& common) {
  auto* sub = app.add_subcommand(
      "discover", "Find what a model misses in recordings, name it, add it, and prove it on unseen ones");
  auto o = std::make_shared<DiscoverCommand>();
  const auto tables = recordings::published_table_names();
  sub->add_option("RECORDING", o->recordings,
                  "files, or names in the data folder; eight of different kinds are good");
  sub->add_option(
         "--table", o->tables,
         "a published table for a bench, in place of recordings: " + tables.front() + " ... " + tables.back())
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
  sub->add_option("--floor", o->floor,
                  "what is left counts as material above this share of a channel's range")
      ->type_name("SHARE")
      ->capture_default_str();
  sub->add_option("--json", o->json, "file of the whole result; - for standard output")
      ->type_name("OUT.json");
  sub->add_option("--report", o->report, "file of the report, a page with pictures")->type_name("OUT.html");
  sub->add_option("--improved", o->improved, "file of the improved model")->type_name("OUT-MODEL.json");
  sub->add_option("--threads", o->threads, "0: as many as the machine has")
      ->check(number_from(0, 256))
      ->capture_default_str();
  sub->add_option("--seed", o->seed, "of the recalibration's other starts")
      ->check(number_from(0))
      ->capture_default_str();
  sub->footer(
      "Prints the findings. Ctrl-C stops it; nothing is written then. While a daemon runs, recordings of the "
      "data\n"
      "folder and tables are its job, which goes on if this command is killed (job.list); files from "
      "elsewhere\n"
      "are searched by the command.\n"
      "Examples:\n"
      "  ferrobench discover --model nec-ae0505d08 *.h5 --report missing.html --improved better.json\n"
      "  ferrobench discover --model nec-single-crystal --table 3.11 --table 3.12\n"
      "  ferrobench discover --model mine.json --held-out loop-3,creep-2 *.h5 --json found.json");
  sub->callback([o, &common] { common.action = [o, &common] { return discover(*o, common); }; });
}

}  // namespace ferrobench::cli
