#include <filesystem>
#include <fstream>
#include <iostream>
#include <thread>

#include "base/visible.h"
#include "recordings/disk/new_file.h"
#include "recordings/file/recover.h"
#include "server/cli/link.h"

namespace ferrobench::cli {

using nlohmann::json;
namespace fs = std::filesystem;

recordings::Existing demand_free(const std::string& file, bool replace,
                                 const std::vector<std::string>& sources) {
  const auto existing = replace ? recordings::Existing::replace : recordings::Existing::keep;
  if (file.empty()) return existing;
  if (recordings::journal_state(file) == recordings::JournalState::being_written)
    throw Error(
        ErrorCode::busy, "this recording is being written",
        Problem{
            .path = "/out",
            .given = file,
            .hint =
                "wait for the end of its run (after its command was killed, until its output is at zero), "
                "or choose another name"});
  if (!replace && server::Store::is_taken(file))
    throw Error(ErrorCode::io_error, "the file is there already",
                Problem{.path = "/out", .given = file, .hint = "choose another name, or add --force"});
  recordings::demand_place(file, existing, sources);
  return existing;
}

namespace {

void copy(const std::string& from, const std::string& to, recordings::Existing existing) {
  recordings::NewFile out(to, existing);
  recordings::FileStream stream(out);
  std::ifstream in(from, std::ios::binary);
  stream << in.rdbuf();
  stream.flush();
  if (!in || fs::file_size(from) != fs::file_size(out.draft()))
    throw Error(ErrorCode::io_error, "the recording could not be copied",
                Problem{.given = to, .hint = "it is " + from});
  out.put();
}

}  // namespace

json follow(json status, const std::function<json(const std::string&)>& ask,
            const std::function<void(const std::string&, const std::string&)>& abort, bool quiet) {
  ProgressLine line;
  int told = 0;
  const auto state = [&] { return status.at("state").get<std::string>(); };
  const std::string id = status.at("run");
  for (int pause = 5; state() != "complete" && state() != "aborted"; pause = std::min(2 * pause, 200)) {
    if (Interrupt::count() > told) {
      line.finish();
      std::cerr << (told == 0 ? "interrupted: a safe stop, the output ramps to zero; again for a faster one\n"
                              : "the output goes to zero as fast as limits and amplifier allow\n");
      try {
        abort(id, "interrupted at the command line");
      } catch (const Error& over) {
        if (over.code() != ErrorCode::bad_state) throw;
      }
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
json carry_out(Link& link, const json& params, const std::string& out, recordings::Existing existing,
               bool quiet, const Common& common) {
  json started;
  if (link.is_daemon()) {
    started = link.call("run.start", params);
  } else {
    auto request = parse<server::RunRequest>(params, ErrorCode::invalid_params, "the run");
    if (const auto name = server::replayed(request.device))
      request.replay_file = recording_argument(*name, common);
    request.existing = existing;
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
    copy(path, out, existing);
    status["path"] = out;
  }
  return status;
}

json carry_out_job(server::Client& daemon, const std::string& method, const json& params) {
  const Interrupt interrupt;
  ProgressLine line;
  auto status = daemon.call(method, params);
  const json job{{"job", status.at("job")}};
  bool cancelled = false;
  for (int pause = 5; status.at("state") == "running"; pause = std::min(2 * pause, 200)) {
    if (Interrupt::count() > 0 && !cancelled) {
      daemon.call("job.cancel", job);
      cancelled = true;
    }
    line.show(cancelled ? "stopping" : status.at("stage").get<std::string>(), status.at("progress"),
              status.value("time_left_s", -1.0));
    std::this_thread::sleep_for(std::chrono::milliseconds(pause));
    status = daemon.call("job.status", job);
  }
  line.finish();
  if (status.at("state") == "failed")
    throw server::failure_of(text_at(status.at("error"), "message"), status.at("error"));
  return status;
}

int tell_stopped() {
  std::cerr << "ferrobench: stopped; nothing was written\n";
  return exit_interrupted;
}

int tell_end(const json& status) {
  const bool complete = status.at("state") == "complete";
  if (!complete)
    std::cerr << "ferrobench: the run was aborted: " << visible(status.at("reason").get<std::string>())
              << '\n';
  if (const auto warning = status.value("warning", ""); !warning.empty())
    std::cerr << "ferrobench: " << visible(warning) << '\n';
  if (complete) return exit_ok;
  return status.at("interrupted").get<bool>() ? exit_interrupted : exit_error;
}

}  // namespace ferrobench::cli
