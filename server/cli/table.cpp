#include "recordings/tables/comparison.h"
#include "server/cli/link.h"
#include "server/cli/words.h"
#include "server/engine/table_runs.h"

namespace ferrobench::cli {

namespace {

struct TableOptions {
  std::string table{}, format{}, out{}, model{}, keep{};
  std::int64_t seed = 1;
  std::vector<std::string> set{};
};

// Nothing if it was stopped.
std::optional<std::string> table_there(const TableOptions& o, server::Client& daemon) {
  const auto status = carry_out_job(daemon, "table.run",
                                    {{"table", o.table},
                                     {"model", model_argument(o.model)},
                                     {"set", set_argument(o.set)},
                                     {"seed", o.seed},
                                     {"format", o.format}});
  const auto& result = status.at("result");
  if (result.is_null()) return std::nullopt;
  return o.format == "json" ? result.dump(2) + "\n" : result.at("content").get<std::string>();
}

std::optional<std::string> table_here(const TableOptions& o, const Common& common) {
  const server::Store store(common.data_folder());
  const auto requests = server::table_requests(o.table, model_argument(o.model), set_argument(o.set), o.seed);
  const Interrupt interrupt;
  ProgressLine line;
  try {
    const auto comparison = server::run_table(o.table, requests, store, o.keep, [&line](double share) {
      line.show("running", share, -1);
      return Interrupt::count() == 0;
    });
    line.finish();
    return render(comparison, recordings::format_from_name(o.format));
  } catch (const Error& error) {
    line.finish();
    if (error.code() != ErrorCode::cancelled || Interrupt::count() == 0) throw;
    return std::nullopt;
  }
}

int table(const TableOptions& o, const Common& common) {
  const TextOutput out(o.out, {o.model});
  auto daemon = o.keep.empty() ? running_daemon(common) : std::nullopt;
  const auto text = daemon ? table_there(o, *daemon) : table_here(o, common);
  if (!text) return tell_stopped();
  out.write(*text);
  return exit_ok;
}

}  // namespace

void add_table(CLI::App& app, Common& common) {
  auto* sub =
      app.add_subcommand("table", "Run a published table's experiments on the virtual device and compare");
  auto o = std::make_shared<TableOptions>();
  sub->add_option("TABLE", o->table, recordings::published_tables_in_words())
      ->required()
      ->check(one_of(recordings::published_table_names()));
  sub->add_option("--format", o->format, "of the table")
      ->check(one_of({"text", "md", "csv", "json", "html"}))
      ->default_val("text");
  sub->add_option("--out", o->out, "default: standard output")->type_name("FILE");
  sub->add_option("--model", o->model, "by name or file; default: the shipped set of the table's specimen");
  sub->add_option("--seed", o->seed, "of the noise")->check(number_from(0))->capture_default_str();
  sub->add_option("--set", o->set, "as for run, for example rate=10; again for more")
      ->type_name("KEY=VALUE")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  sub->add_option("--keep", o->keep, "folder where the recordings stay; default: they are not kept")
      ->type_name("DIR");
  sub->footer(
      "Ctrl-C stops it. While a daemon runs, it is the daemon's job, which goes on if this command is "
      "killed\n"
      "(job.list); with --keep it is the command's own.\n"
      "Examples:\n  ferrobench table 3.13\n  ferrobench table 3.11 --set rate=10 --format json");
  sub->callback([o, &common] { common.action = [o, &common] { return table(*o, common); }; });
}

}  // namespace ferrobench::cli
