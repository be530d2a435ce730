#include "server/methods/methods.h"

namespace ferrobench::server {
namespace {

struct RunParams {
  std::string run{};
};
template <class Visitor>
void describe(Visitor& visit, RunParams& p) {
  visit("run", p.run, {.doc = "\"\": the latest"});
}
struct AbortParams {
  std::string run{}, reason{};
};
template <class Visitor>
void describe(Visitor& visit, AbortParams& p) {
  visit("run", p.run, {.doc = "\"\": the latest"});
  visit("reason", p.reason, {.doc = "kept in the recording, beside who stopped it"});
}
struct RunList {
  std::vector<RunStatus> runs{};
};
template <class Visitor>
void describe(Visitor& visit, RunList& l) {
  visit("runs", l.runs, {.required = true, .doc = "since the daemon started, newest first"});
}

}  // namespace

void add_run_methods(Dispatcher& rpc, Engine& engine) {
  rpc.add<RunRequest>({.name = "run.start",
                       .doc = "Checks a program against the limits, starts it and returns at once.",
                       .role = Role::control},
                      [&engine](const RunRequest& request) { return engine.start(request); });
  rpc.add<RunParams>({.name = "run.status", .doc = "State, progress and time left."},
                     [&engine](const RunParams& p) { return engine.status(p.run); });
  rpc.add<RunParams>({.name = "run.pause",
                      .doc = "Waits in the next hold, which gets longer; samples keep coming.",
                      .role = Role::control},
                     [&engine](const RunParams& p) {
                       engine.pause(p.run);
                       return engine.status(p.run);
                     });
  rpc.add<RunParams>({.name = "run.resume", .doc = "Goes on after a pause.", .role = Role::control},
                     [&engine](const RunParams& p) {
                       engine.resume(p.run);
                       return engine.status(p.run);
                     });
  rpc.add<AbortParams>(
      {.name = "run.abort",
       .doc = "The emergency stop: the output ramps to zero. For everybody, whoever holds the lease.",
       .role = Role::stop},
      [&engine](const AbortParams& p, CallContext& caller) {
        engine.abort(p.run, "stopped by " + caller.client + (p.reason.empty() ? "" : ": " + p.reason));
        return engine.status(p.run);
      });
  rpc.add<NoParams>({.name = "run.list", .doc = "The runs since the daemon started."},
                    [&engine](const NoParams&) { return RunList{engine.runs()}; });
}

}  // namespace ferrobench::server
