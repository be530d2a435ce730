#include "server/engine/rerun.h"

#include <iostream>

#include "recordings/file/reader.h"
#include "server/cli/link.h"
#include "server/engine/verify.h"

namespace ferrobench::cli {

namespace {

struct RerunOptions {
  std::string recording{}, device{}, out{}, notes{};
  bool force = false, quiet = false;
};

int rerun(const RerunOptions& o, const Common& common) {
  const auto path = recording_argument(o.recording, common);
  const auto existing = demand_free(o.out, o.force, {path});
  const auto before = recordings::read_recording(path);
  auto request = server::rerun_request(before);
  const bool is_virtual = request.device == "virtual" && o.device.empty();
  if (!o.device.empty()) request.device = o.device;
  request.notes = o.notes;
  const Interrupt interrupt;
  Link link(common);
  const auto status = carry_out(link, write_json(request), o.out, existing, o.quiet, common);
  const auto out = status.at("path").get<std::string>();
  if (!out.empty()) std::cout << out << '\n';
  if (const int code = tell_end(status); code != exit_ok || !is_virtual) return code;
  // A note of this run is no part of what is compared.
  auto again = recordings::read_recording(out);
  if (!o.notes.empty()) std::erase_if(again.events, [&](const auto& e) { return e.message == o.notes; });
  if (const auto found = server::first_difference(before, again)) {
    std::cerr
        << "differs from " << path << " (then and now) in " << *found
        << "\nA run that was paused, stopped, or made on a specimen with a past cannot come out the same.\n";
    return exit_error;
  }
  std::cerr << "identical to " << path << '\n';
  return exit_ok;
}

}  // namespace

void add_rerun(CLI::App& app, Common& common) {
  auto* sub = app.add_subcommand(
      "rerun", "Run a recording's experiment again, from what its file alone holds; prints the new file");
  auto o = std::make_shared<RerunOptions>();
  sub->add_option("RECORDING", o->recording, "a file, or the name of a recording in the data folder")
      ->required();
  sub->add_option("--device", o->device, "one opened before; default: a device of the recording's kind");
  sub->add_option("--out", o->out, "file of the new recording; default: a new one in the data folder")
      ->type_name("FILE.h5");
  sub->add_flag("--force", o->force, "replace the file if it is there, once the new one is whole");
  sub->add_option("--notes", o->notes, "kept in the new recording");
  sub->add_flag("--quiet", o->quiet, "no progress");
  sub->footer(
      "Of the virtual device the same seed gives the same samples, which is checked: exit code 1 if not. The "
      "new\n"
      "recording names the old one by its identifier (rerun_of).\n"
      "Example:\n  ferrobench rerun creep.h5 --out again.h5");
  sub->callback([o, &common] { common.action = [o, &common] { return rerun(*o, common); }; });
}

}  // namespace ferrobench::cli
