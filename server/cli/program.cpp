#include <cstdio>
#include <iostream>

#include "base/error.h"
#include "recordings/format/version.h"
#include "server/cli/cli.h"
#include "server/cli/words.h"

namespace ferrobench::cli {

void build_program(CLI::App& app, Common& common) {
  app.description(
      "ferrobench: field programs on ferroelectric actuators, from the experiment to the report.\n"
      "Without a daemon (ferrobench serve) the same engine runs within the command.");
  app.footer(
      "Examples:\n"
      "  ferrobench protocol list\n"
      "  ferrobench run creep-6-holds-fast --fast --set prestress_MPa=8\n"
      "  ferrobench report creep-6-holds-fast_20260101T120000Z --format html --out creep.html\n"
      "  ferrobench table 3.13\n"
      "  ferrobench serve\n"
      "Exit codes: 0 done, 1 error, 2 wrong usage, 130 interrupted (after a safe stop).");
  app.set_version_flag("--version", "ferrobench " + std::string(recordings::software_version()) + " (" +
                                        std::string(recordings::software_commit()) + ")");
  app.add_option("--data", common.data, "folder of recordings and models [FERROBENCH_DATA]")
      ->type_name("DIR");
  app.add_option("--socket", common.socket,
                 "Unix socket of the daemon; default: daemon.sock in the data folder")
      ->type_name("PATH");
  app.add_option("--lease", common.lease, "what lease.acquire told, while only its holder may control")
      ->envname("FERROBENCH_LEASE");
  app.require_subcommand(1);
  app.fallthrough();
  app.get_formatter()->column_width(34);
  add_serve(app, common);
  add_run(app, common);
  add_replay(app, common);
  add_rerun(app, common);
  add_compare(app, common);
  add_average(app, common);
  add_queue(app, common);
  add_list(app, common);
  add_recover(app, common);
  add_report(app, common);
  add_table(app, common);
  add_simulate(app, common);
  add_fit(app, common);
  add_discover(app, common);
  add_batch(app, common);
  add_protocol(app, common);
  add_model(app, common);
  add_effects(app, common);
  add_selftest(app, common);
  add_limits(app, common);
  add_call(app, common);
  add_export(app, common);
  add_import(app, common);
}

int run_program(int argc, const char* const* argv) {
  CLI::App app;
  Common common;
  build_program(app, common);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    std::cerr << "ferrobench: " << usage_in_words(error, app) << '\n';
    return exit_usage;
  }
  try {
    const int code = common.action();
    if (std::cout.flush() && std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return code;
    throw Error(ErrorCode::io_error, "the output could not be written",
                Problem{.hint = "see where standard output leads to"});
  } catch (const Error& error) {
    std::cerr << "ferrobench: " << in_users_words(error, chosen(app)).what() << '\n';
  } catch (const std::exception& error) {
    std::cerr << "ferrobench: " << error.what() << '\n';
  }
  return exit_error;
}

std::string help_of(const std::vector<std::string>& arguments) {
  CLI::App app;
  Common common;
  build_program(app, common);
  CLI::App* at = &app;
  for (const auto& name : arguments) at = at->get_subcommand(name);
  return at->help();
}

}  // namespace ferrobench::cli
