#include <unistd.h>

#include <filesystem>
#include <iostream>

#include "server/batch/slurm.h"
#include "server/cli/cli.h"
#include "server/cli/words.h"

namespace ferrobench::cli {

namespace {

struct BatchCommand {
  std::string manifest{}, out{};
  int local = 0;
  bool slurm = false, no_wait = false;
  batch::SlurmOptions how{};
  batch::BatchOptions batch{};
};

struct WorkCommand {
  std::string folder{};
  std::int64_t task = 0, item = -1;
  int threads = 1;
};

int tell_summary(const batch::Summary& summary, const batch::BatchFolder& folder) {
  std::cout << (folder.path() / "index.html").string() << '\n';
  const auto all = summary.done + summary.failed + summary.missing;
  std::cerr << summary.done << " of " << all << " done";
  if (summary.failed > 0) std::cerr << ", " << summary.failed << " failed";
  if (summary.missing > 0) std::cerr << ", " << summary.missing << " missing";
  if (summary.done == all) {
    std::cerr << '\n';
    return exit_ok;
  }
  std::cerr << "; the same command again does these alone\n";
  return exit_error;
}

int run_batch(batch::Kind kind, const BatchCommand& o, const Common& common) {
  auto items = batch::read_manifest(kind, o.manifest, server::Store(common.data_folder()));
  const Interrupt interrupt;
  ProgressLine line;
  std::optional<std::chrono::steady_clock::time_point> begin;
  auto options = o.batch;
  options.progress = [&](const batch::Progress& p) {
    if (p.of == 0) return Interrupt::count() == 0;
    if (!begin) begin = std::chrono::steady_clock::now();
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - *begin;
    const auto over = static_cast<double>(p.over), of = static_cast<double>(p.of);
    line.show(p.stage + ", " + std::to_string(p.over) + " of " + std::to_string(p.of), over / of,
              p.over > 0 ? spent.count() * (of - over) / over : -1);
    return Interrupt::count() == 0;
  };
  batch::Batch work(kind, std::move(items), o.out, options);
  bool stopped = false;
  if (o.slurm) {
    auto how = o.how;
    how.wait = !o.no_wait;
    const auto end = run_by_slurm(work, how);
    line.finish();
    if (end.goes_on)
      std::cerr << "job " << end.job << " goes on; the same command again waits for it, 'scancel " << end.job
                << "' ends it\n";
    if (end.goes_on) return Interrupt::count() > 0 ? exit_interrupted : exit_ok;
    if (end.cancelled) std::cerr << "job " << end.job << " was cancelled\n";
  } else {
    if (is_at_work(work.folder()))
      throw Error(
          ErrorCode::busy, "job " + work.folder().job() + " is at work in this folder",
          Problem{.path = "/out",
                  .given = work.folder().path().string(),
                  .hint = "add --slurm to wait for it, or end it by 'scancel " + work.folder().job() + "'"});
    work.prepare();
    stopped = !work.run_here(o.local > 0 ? o.local : 1);
    line.finish();
  }
  const int code = tell_summary(work.merge(), work.folder());
  return stopped ? exit_interrupted : code;
}

int work(const WorkCommand& o) {
  const batch::BatchFolder folder(o.folder);
  if (o.item >= 0) try {
      work_on_item(folder, o.task, static_cast<std::size_t>(o.item), o.threads);
      return exit_ok;
    } catch (const std::exception& error) {  // the log of the task is its standard output
      std::cout << error.what() << std::endl;
      return exit_error;
    }
  const Interrupt interrupt;
  return work_on_task(folder, o.task, o.threads, [] { return Interrupt::count() > 0; }) ? exit_ok
                                                                                        : exit_interrupted;
}

void add_kind(CLI::App& parent, batch::Kind kind, const std::string& what, const std::string& footer,
              Common& common) {
  auto* sub = parent.add_subcommand(batch::kind_name(kind), what);
  auto o = std::make_shared<BatchCommand>();
  sub->add_option("MANIFEST", o->manifest, "file of the items (JSON)")->required();
  sub->add_option("--out", o->out, "folder of the results; on a cluster one that all machines share")
      ->type_name("FOLDER")
      ->required();
  auto* local = sub->add_option("--local", o->local, "so many items at a time, on this machine; default: 1")
                    ->check(number_from(1, 1024))
                    ->type_name("N");
  auto* slurm =
      sub->add_flag("--slurm", o->slurm, "as one job array of Slurm, and wait for it")->excludes(local);
  sub->add_option("--threads", o->batch.threads, "of each item; results do not depend on it")
      ->check(number_from(1, 256))
      ->capture_default_str();
  sub->add_option("--chunk", o->batch.chunk, "items of a task; 0: so many that there are at most 1000 tasks")
      ->check(number_from(0, 1e6))
      ->capture_default_str();
  sub->add_flag("--replace", o->batch.replace, "do again what another commit of ferrobench has done");
  sub->add_option("--partition", o->how.partition, "of the cluster")->type_name("NAME")->needs(slurm);
  sub->add_option("--time", o->how.time, "limit of a task, as sbatch takes it, for example 2:00:00")
      ->type_name("TIME")
      ->needs(slurm);
  sub->add_option("--sbatch-option", o->how.options,
                  "a further one of sbatch, for example --mem=4G; again for more")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
      ->type_name("OPTION")
      ->needs(slurm);
  sub->add_flag("--no-wait", o->no_wait, "submit and leave; the same command again waits, and merges")
      ->needs(slurm);
  sub->footer(footer);
  sub->callback(
      [o, kind, &common] { common.action = [o, kind, &common] { return run_batch(kind, *o, common); }; });
}

}  // namespace

void add_batch(CLI::App& app, Common& common) {
  auto* sub = app.add_subcommand("batch", "Do the same to thousands of specimens, here or on a cluster");
  sub->require_subcommand(1);
  add_kind(*sub, batch::Kind::discover, "Find what a model misses in each item's recordings",
           "Manifest: {\"model\": \"soft-pzt\", \"options\": {\"floor\": 0.005}, \"items\": [\n"
           "  {\"id\": \"stack-017\", \"recordings\": [\"017/loops.h5\", \"017/creep.h5\"]}, ...]}\n"
           "An item may have model, held_out (recordings to lock away) and options of its own. Options: "
           "floor, seed,\n"
           "candidates (effects that may be named), report (false: no page for each item).\n"
           "Examples:\n"
           "  ferrobench batch discover fleet.json --local 4 --out found\n"
           "  ferrobench batch discover fleet.json --slurm --time 2:00:00 --out /shared/found",
           common);
  add_kind(*sub, batch::Kind::fit, "Fit a model to each item's recordings",
           "Manifest: {\"model\": \"soft-pzt\", \"options\": {\"starts\": 1}, \"items\": [\n"
           "  {\"id\": \"stack-017\", \"recordings\": [\"017/loops.h5\"]}, ...]}\n"
           "Options: free, starts, iterations, seed, calibrate, report (false: no page for each item).\n"
           "Example:\n"
           "  ferrobench batch fit fleet.json --local 4 --out fitted",
           common);
  add_kind(*sub, batch::Kind::report, "Report each item's recordings",
           "Manifest: {\"items\": [{\"id\": \"stack-017\", \"recordings\": [\"017/loops.h5\"]}, ...]}\n"
           "The table has the medians of each report's columns. Options: report (false: no page for each "
           "recording).\n"
           "Example:\n"
           "  ferrobench batch report fleet.json --local 4 --out reports",
           common);
  add_kind(*sub, batch::Kind::import, "Make recordings of what testers and other programs wrote",
           "Manifest: {\"options\": {\"map\": {\"area_m2\": 25e-6}}, \"items\": [\n"
           "  {\"id\": \"stack-017\", \"files\": [\"017/loops.dat\"]}, ...]}\n"
           "The recordings of an item lie in FOLDER/items/ID. Options: as (kind of the files), map (what "
           "stands in which\n"
           "column, and what is known of the specimen, in SI; see 'ferrobench import --help').\n"
           "Example:\n"
           "  ferrobench batch import fleet.json --local 4 --out imported",
           common);
  auto* inner = sub->add_subcommand("work", "A task of a job array, or an item, in its own process");
  inner->group("");  // for the program itself
  auto o = std::make_shared<WorkCommand>();
  inner->add_option("FOLDER", o->folder)->required();
  inner->add_option("TASK", o->task)->required();
  inner->add_option("--item", o->item);
  inner->add_option("--threads", o->threads);
  inner->callback([o, &common] { common.action = [o] { return work(*o); }; });
  sub->footer(
      "Every item has a result of its own in FOLDER/items, and all of them together are FOLDER/table.csv, "
      "table.h5 and\n"
      "index.html. The same command again does only what is missing, has failed, or has other inputs or "
      "options now.\n"
      "Exit codes: 0 all done, 1 some failed or are missing, 130 interrupted.\n"
      "Examples:\n"
      "  ferrobench batch report fleet.json --local 2 --out reports\n"
      "  ferrobench batch discover --help");
}

}  // namespace ferrobench::cli
