#include "server/methods/methods.h"
#include "server/queue/queue.h"

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
struct ReplayRequest {
  std::string recording{};
  bool fast = false;
  double speed = 1;
  std::optional<double> from{}, to{};  // s
  nlohmann::json set = nlohmann::json::object();
  std::string notes{}, idempotency_key{};
};
template <class Visitor>
void describe(Visitor& visit, ReplayRequest& r) {
  visit("recording", r.recording, {.required = true, .doc = "name of a recording"});
  visit("fast", r.fast, {.doc = "as fast as it can go, whatever the speed"});
  visit("speed", r.speed, {.min = 1, .max = 1e6, .doc = "times the recorded speed"});
  visit("from_s", r.from, {.unit = "s", .doc = "start of the part to play; absent: the recording's"});
  visit("to_s", r.to, {.unit = "s", .doc = "end of the part to play; absent: the recording's"});
  visit("set", r.set,
        {.doc = "values by key: device.<channel>.gain, device.<channel>.offset (SI), device.played"});
  visit("notes", r.notes, {.doc = "kept in the recording"});
  visit("idempotency_key", r.idempotency_key,
        {.doc = "a second start with the same key returns the first one's run"});
}
RunRequest run_of(const ReplayRequest& r) {
  RunRequest out;
  out.device = "replay:" + r.recording;
  out.fast = r.fast;
  out.set = r.set;
  out.notes = r.notes;
  out.idempotency_key = r.idempotency_key;
  if (!out.set.is_object()) return out;  // refused where settings are read
  out.set["device.speed"] = r.speed;
  if (r.from) out.set["device.from"] = *r.from;
  if (r.to) out.set["device.to"] = *r.to;
  return out;
}

struct RunList {
  std::vector<RunStatus> runs{};
};
template <class Visitor>
void describe(Visitor& visit, RunList& l) {
  visit("runs", l.runs, {.required = true, .doc = "since the daemon started, newest first"});
}

const std::vector<ErrorCode> start_errors{
    ErrorCode::busy,           ErrorCode::bad_state,      ErrorCode::not_found,
    ErrorCode::bad_protocol,   ErrorCode::bad_model,      ErrorCode::bad_recording,
    ErrorCode::limit_exceeded, ErrorCode::interlock_open, ErrorCode::device_unavailable,
    ErrorCode::device_lost,    ErrorCode::io_error,       ErrorCode::disk_full,
    ErrorCode::numerical};

}  // namespace

void add_run_methods(Dispatcher& rpc, Engine& engine, const std::shared_ptr<Queue>& queue) {
  rpc.add<RunRequest>({.name = "run.start",
                       .doc = "Checks a program against the limits, starts it and returns at once.",
                       .role = Role::control,
                       .errors = start_errors},
                      [&engine](const RunRequest& request) { return engine.start(request); });
  rpc.add<RunParams>({.name = "run.status",
                      .doc = "State, progress and time left.",
                      .lane = Lane::urgent,
                      .errors = {ErrorCode::not_found}},
                     [&engine](const RunParams& p) { return engine.status(p.run); });
  rpc.add<RunParams>({.name = "run.pause",
                      .doc = "Waits in the next hold, which gets longer; samples keep coming.",
                      .role = Role::control,
                      .errors = {ErrorCode::not_found, ErrorCode::bad_state, ErrorCode::device_lost}},
                     [&engine](const RunParams& p) { return engine.pause(p.run); });
  rpc.add<RunParams>({.name = "run.resume",
                      .doc = "Goes on after a pause.",
                      .role = Role::control,
                      .errors = {ErrorCode::not_found, ErrorCode::bad_state, ErrorCode::device_lost}},
                     [&engine](const RunParams& p) { return engine.resume(p.run); });
  rpc.add<AbortParams>(
      {.name = "run.abort",
       .doc = "The emergency stop: the output ramps to zero at stop_slew; asked for a second time, at slew. "
              "Without a run's id a self-test is stopped too. The queue stops with it. For everybody, "
              "whoever holds "
              "the lease.",
       .role = Role::stop,
       .errors = {ErrorCode::not_found, ErrorCode::bad_state}},
      [&engine, queue](const AbortParams& p, CallContext& caller) {
        if (caller.again)
          if (auto status = engine.status(p.run); is_over(status.state)) return status;
        const auto reason = "stopped by " + caller.client + (p.reason.empty() ? "" : ": " + p.reason);
        // First: nothing starts between. A stop of a run that is over long since is none of the queue.
        const bool halted = (p.run.empty() || engine.status().run == p.run) && queue->halt(reason);
        try {
          return engine.abort(p.run, reason, caller.again);
        } catch (const Error& nothing) {
          if (!halted || nothing.code() != ErrorCode::bad_state) throw;
          return engine.status();
        }
      });
  rpc.add<ReplayRequest>({.name = "replay.start",
                          .doc = "Runs a recording again as it was measured, into a new recording.",
                          .role = Role::control,
                          .errors = start_errors},
                         [&engine](const ReplayRequest& r) { return engine.start(run_of(r)); });
  rpc.add<NoParams>({.name = "run.list", .doc = "The runs since the daemon started."},
                    [&engine](const NoParams&) { return RunList{engine.runs()}; });
}

}  // namespace ferrobench::server
