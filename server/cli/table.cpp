#include "recordings/tables/comparison.h"
#include "server/cli/link.h"
#include "server/engine/table_runs.h"

namespace ferrobench::cli {

namespace {

struct TableOptions {
  std::string table{}, format{}, out{}, model{}, keep{};
  std::int64_t seed = 1;
  std::vector<std::string> set{};
};

int table(const TableOptions& o, const Common& common) {
  const server::Store store(common.data_folder());
  const auto requests = server::table_requests(o.table, model_argument(o.model), set_argument(o.set), o.seed);
  const auto comparison = server::run_table(o.table, requests, store, o.keep);
  write_output(o.out, render(comparison, recordings::format_from_name(o.format)));
  return exit_ok;
}

}  // namespace

void add_table(CLI::App& app, Common& common) {
  auto* sub =
      app.add_subcommand("table", "Run a published table's experiments on the virtual device and compare");
  auto o = std::make_shared<TableOptions>();
  sub->add_option("TABLE", o->table, "3.10, 3.11, 3.12 or 3.13")
      ->required()
      ->check(CLI::IsMember(recordings::published_table_names()));
  sub->add_option("--format", o->format, "of the table")
      ->check(CLI::IsMember(std::vector<std::string>{"text", "md", "csv", "json", "html"}))
      ->default_val("text");
  sub->add_option("--out", o->out, "default: standard output")->type_name("FILE");
  sub->add_option("--model", o->model, "by name or file; default: the shipped set of the table's specimen");
  sub->add_option("--seed", o->seed, "of the noise")->check(CLI::NonNegativeNumber)->capture_default_str();
  sub->add_option("--set", o->set, "as for run, for example rate=10; again for more")
      ->type_name("KEY=VALUE")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  sub->add_option("--keep", o->keep, "folder where the recordings stay; default: they are not kept")
      ->type_name("DIR");
  sub->footer("Examples:\n  ferrobench table 3.13\n  ferrobench table 3.11 --set rate=10 --format json");
  sub->callback([o, &common] { common.action = [o, &common] { return table(*o, common); }; });
}

}  // namespace ferrobench::cli
