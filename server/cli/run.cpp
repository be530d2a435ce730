#include <iostream>

#include "server/cli/link.h"
#include "server/cli/words.h"

namespace ferrobench::cli {

namespace {

struct RunOptions : RunChoice {
  std::string out{};
  bool force = false, quiet = false;
};

int run(const RunOptions& o, const Common& common) {
  std::vector<std::string> sources{o.protocol, o.model, o.config};
  if (const auto name = server::replayed(o.device)) sources.push_back(recording_argument(*name, common));
  const auto existing = demand_free(o.out, o.force, sources);
  const Interrupt interrupt;
  Link link(common);
  const auto status = carry_out(link, run_argument(o), o.out, existing, o.quiet, common);
  const auto path = status.at("path").get<std::string>();
  const int code = tell_end(status);
  if (!path.empty()) std::cout << path << '\n';
  return code;
}

}  // namespace

void add_run(CLI::App& app, Common& common) {
  auto* sub = app.add_subcommand("run", "Run a protocol on a device; prints the recording's file");
  auto o = std::make_shared<RunOptions>();
  sub->add_option("PROTOCOL", o->protocol,
                  "name of a protocol that ships or was put into the data folder, or a file: .json, or .csv "
                  "of time and level, in s and kV/mm unless its "
                  "headings say otherwise (voltage_V, E [MV/m], t/ms); none for a replay");
  sub->add_option("--device", o->device, "kind of device, one opened before, or replay:RECORDING")
      ->capture_default_str();
  sub->add_option("--device-config", o->config, "what the device is and what is wired to it")
      ->type_name("FILE.json");
  sub->add_option("--model", o->model, "virtual device: model by name or file");
  sub->add_flag("--fast", o->fast, "virtual device and replay: as fast as it can go");
  sub->add_option("--seed", o->seed, "virtual device: of the noise; same seed, same signals")
      ->check(number_from(0))
      ->capture_default_str();
  sub->add_option("--out", o->out, "file of the recording; default: a new one in the data folder")
      ->type_name("FILE.h5");
  sub->add_flag("--force", o->force, "replace the file if it is there, once the new one is whole");
  sub->add_option("--set", o->set,
                  "a parameter of the protocol, prestress_MPa, prestress_Pa, spring_stiffness_N_per_m, "
                  "sample_rate_Hz, model.<path>, device.<path>; again for more")
      ->type_name("KEY=VALUE")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  sub->add_option("--notes", o->notes, "kept in the recording");
  sub->add_flag("--quiet", o->quiet, "no progress");
  sub->footer(
      "Ctrl-C is a safe stop: the output ramps to zero before the command ends.\n"
      "Examples:\n"
      "  ferrobench run full-loops --fast\n"
      "  ferrobench run creep-6-holds-fast --fast --set rate=10 --set prestress_MPa=8 --out creep.h5\n"
      "  ferrobench run stage-full-range --model mcl-op30 --set model.material.barrier=5e4\n"
      "  ferrobench run --device replay:creep.h5 --fast --out again.h5");
  sub->callback([o, &common] {
    if (o->protocol.empty() && !o->device.starts_with("replay:")) throw CLI::RequiredError("PROTOCOL");
    common.action = [o, &common] { return run(*o, common); };
  });
}

}  // namespace ferrobench::cli
