#include <filesystem>
#include <iostream>
#include <thread>

#include "recordings/recover.h"
#include "server/cli/link.h"

namespace ferrobench::cli {

using nlohmann::json;
namespace fs = std::filesystem;

void demand_free(const std::string& file, bool replace, const std::string& source) {
  std::error_code failure;
  if (!file.empty() && !source.empty() && fs::equivalent(source, file, failure))
    throw Error(ErrorCode::invalid_params, "the recording would replace itself",
                Problem{.path = "/out", .given = file, .hint = "choose another name"});
  if (file.empty() || !server::Store::is_taken(file)) return;
  if (!replace)
    throw Error(ErrorCode::io_error, "the file is there already",
                Problem{.path = "/out", .given = file, .hint = "choose another name, or add --force"});
  recordings::remove_recording(file);
}

json follow(json status, const std::function<json(const std::string&)>& ask,
            const std::function<void(const std::string&, const std::string&)>& abort, bool quiet) {
  ProgressLine line;
  int told = 0;
  const auto state = [&] { return status.at("state").get<std::string>(); };
  const std::string id = status.at("run");
  for (int pause = 5; state() != "complete" && state() != "aborted"; pause = std::min(2 * pause, 200)) {
    if (Interrupt::count() > told) {
      line.finish();
      std::cerr << (told == 0 ? "interrupted: a safe stop, the output ramps to zero\n"
                              : "the output is on its way to zero; this takes until it is there\n");
      if (told == 0) abort(id, "interrupted at the command line");
      told = Interrupt::count();
    }
    if (!quiet) line.show(state(), status.at("progress"), status.value("time_left_s", -1.0));
    std::this_thread::sleep_for(std::chrono::milliseconds(pause));
    status = ask(id);
  }
  line.finish();
  status["interrupted"] = told > 0;
  return status;
}

// A daemon records in its own folder, so the file asked for is a copy; and it plays its own recordings by
// their names.
json carry_out(Link& link, const json& params, const std::string& out, bool quiet, const Common& common) {
  json started;
  if (link.is_daemon()) {
    started = link.call("run.start", params);
  } else {
    auto request = parse<server::RunRequest>(params, ErrorCode::invalid_params, "the run");
    if (const auto name = server::replayed(request.device))
      request.replay_file = recording_argument(*name, common);
    started = write_json(link.engine().start(request, out));
  }
  auto status = follow(
      started,
      [&](const std::string& id) {
        return link.call("run.status", {{"run", id}});
      },
      [&](const std::string& id, const std::string& reason) {
        link.call("run.abort", {{"run", id}, {"reason", reason}});
      },
      quiet);
  const auto path = status.at("path").get<std::string>();
  if (link.is_daemon() && !out.empty() && fs::exists(path)) {
    fs::copy_file(path, out);
    status["path"] = out;
  }
  return status;
}

int tell_end(const json& status) {
  const bool complete = status.at("state") == "complete";
  if (!complete)
    std::cerr << "ferrobench: the run was aborted: " << status.at("reason").get<std::string>() << '\n';
  if (!status.at("output_at_zero").get<bool>())
    std::cerr << "ferrobench: the device did not obey, its output may not be at zero\n";
  if (complete) return exit_ok;
  return status.at("interrupted").get<bool>() ? exit_interrupted : exit_error;
}

}  // namespace ferrobench::cli
