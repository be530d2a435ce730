#include <map>

#include "recordings/format/iso_time.h"
#include "recordings/format/version.h"
#include "server/methods/methods.h"
#include "server/queue/queue.h"
#include "server/rpc/discover.h"
#include "server/rpc/subscribe.h"

namespace ferrobench::server {
namespace {

struct SystemInfo {
  std::string version{}, commit{}, data_folder{}, time{};
  double uptime = 0;  // s
  daq::Limits limits{};
  RunState run_state = RunState::idle;
};
template <class Visitor>
void describe(Visitor& visit, SystemInfo& s) {
  visit("version", s.version, {.required = true});
  visit("commit", s.commit, {.required = true});
  visit("data_folder", s.data_folder, {.doc = "recordings are in \"recordings\" below it"});
  visit("time", s.time,
        {.required = true, .doc = "by the daemon's clock, ISO 8601: that of every moment that it tells"});
  visit("uptime_s", s.uptime, {.unit = "s"});
  visit("limits", s.limits, {.doc = "in force"});
  visit("run_state", s.run_state, {});
}

// Every limit, but none of them needed.
struct LimitsChange {
  std::map<std::string, std::optional<double>, std::less<>> named{};
  std::string reason{};
};
template <class Visitor>
void describe(Visitor& visit, LimitsChange& change) {
  auto each = [&](std::string_view name, double&, const FieldInfo& info) {
    visit(name, change.named[std::string(name)], info);
  };
  daq::Limits all;
  describe(each, all);
  visit("reason", change.reason,
        {.doc = "told with the change; wanted where a stop may take longer than 10 s"});
}

struct JobParams {
  std::string job{};
};
template <class Visitor>
void describe(Visitor& visit, JobParams& p) {
  visit("job", p.job, {.required = true, .doc = "id of a job or a run"});
}

struct JobList {
  std::vector<JobStatus> jobs{};
};
template <class Visitor>
void describe(Visitor& visit, JobList& l) {
  visit("jobs", l.jobs, {.required = true, .doc = "a run is a job as well, and stands in run.list"});
}

struct LeaseParams {
  std::string lease{};
  double seconds = 60;
};
template <class Visitor>
void describe(Visitor& visit, LeaseParams& p) {
  visit("lease", p.lease, {.doc = "\"\": the one of this connection"});
  visit("duration_s", p.seconds, {.unit = "s", .min = 1, .max = 3600, .doc = "how long without renewal"});
}

struct ReleaseParams {
  std::string lease{};
};
template <class Visitor>
void describe(Visitor& visit, ReleaseParams& p) {
  visit("lease", p.lease, {.doc = "\"\": the one of this connection"});
}

struct PresentParams {
  std::string lease{};
};
template <class Visitor>
void describe(Visitor& visit, PresentParams& p) {
  visit("lease", p.lease, {.required = true, .doc = "as lease.acquire told it"});
}

struct AcquireParams {
  double seconds = 60;
  bool stop_run = false;
};
template <class Visitor>
void describe(Visitor& visit, AcquireParams& p) {
  visit("duration_s", p.seconds, {.unit = "s", .min = 1, .max = 3600, .doc = "how long without renewal"});
  visit("stop_run", p.stop_run,
        {.doc = "if the lease runs out, neither renewed nor released, the run under way is stopped safely"});
}

JobStatus as_job(const RunStatus& run) {
  JobStatus job{.job = run.run,
                .kind = "run",
                .progress = run.progress,
                .stage = write_json(run.state).get<std::string>(),
                .time_left = run.time_left,
                .estimated_end = moment_in(run.time_left)};
  if (run.state == RunState::complete) {
    job.state = JobState::complete;
    job.result = write_json(run);
  } else if (run.state == RunState::aborted) {
    job.state = JobState::cancelled;
    job.error = {{"name", entry(ErrorCode::cancelled).name}, {"message", run.reason}};
  }
  return job;
}

void add_jobs(Dispatcher& rpc, Engine& engine) {
  rpc.add<NoParams>({.name = "job.list", .doc = "The jobs of this daemon, newest first, without results."},
                    [&engine](const NoParams&) {
                      JobList out{engine.jobs().list()};
                      for (auto& job : out.jobs) job.result = nullptr;
                      return out;
                    });
  rpc.add<JobParams>({.name = "job.status",
                      .doc = "How far a job is, and its result. Every run is a job as well.",
                      .errors = {ErrorCode::not_found}},
                     [&engine](const JobParams& p) {
                       return engine.jobs().knows(p.job) ? engine.jobs().status(p.job)
                                                         : as_job(engine.status(p.job));
                     });
  rpc.add<JobParams>({.name = "job.cancel",
                      .doc = "Cancels a job; a run stops safely.",
                      .role = Role::control,
                      .errors = {ErrorCode::not_found, ErrorCode::bad_state}},
                     [&engine](const JobParams& p) {
                       if (engine.jobs().knows(p.job)) {
                         engine.jobs().cancel(p.job);
                         return engine.jobs().status(p.job);
                       }
                       return as_job(engine.abort(p.job, "cancelled by a client"));
                     });
}

void add_leases(Dispatcher& rpc, Engine& engine) {
  rpc.add<AcquireParams>({.name = "lease.acquire",
                          .doc = "Makes the caller the only one who may control. Another connection may "
                                 "lease.present it, by HTTP as the field Ferrobench-Lease. Anybody may still "
                                 "run.abort.",
                          .audited = true,
                          .errors = {ErrorCode::not_controller}},
                         [&engine](const AcquireParams& p, CallContext& caller) {
                           return engine.lease().acquire(caller, p.seconds, p.stop_run);
                         });
  rpc.add<PresentParams>({.name = "lease.present",
                          .doc = "Lets this connection control as well, as long as the lease lasts.",
                          .errors = {ErrorCode::not_controller}},
                         [&engine](const PresentParams& p, CallContext& caller) {
                           return engine.lease().present(caller, p.lease);
                         });
  rpc.add<LeaseParams>({.name = "lease.renew",
                        .doc = "Keeps the lease for another while.",
                        .errors = {ErrorCode::not_controller}},
                       [&engine](const LeaseParams& p, CallContext& caller) {
                         return engine.lease().renew(caller, p.lease, p.seconds);
                       });
  rpc.add<ReleaseParams>(
      {.name = "lease.release",
       .doc = "Gives the lease back.",
       .audited = true,
       .errors = {ErrorCode::not_controller}},
      [&engine](const ReleaseParams& p, CallContext& caller) { engine.lease().release(caller, p.lease); });
  rpc.add<NoParams>({.name = "lease.status", .doc = "Who controls, if anybody."},
                    [&engine](const NoParams&) { return engine.lease().status(); });
}

}  // namespace

void add_system_methods(Dispatcher& rpc, Engine& engine) {
  rpc.add<NoParams>({.name = "system.info", .doc = "Versions, uptime and the limits in force."},
                    [&engine](const NoParams&) {
                      return SystemInfo{.version = std::string(recordings::software_version()),
                                        .commit = std::string(recordings::software_commit()),
                                        .data_folder = engine.store().folder().string(),
                                        .time = recordings::iso_now(),
                                        .uptime = engine.uptime(),
                                        .limits = engine.limits(),
                                        .run_state = engine.status().state};
                    });
  rpc.add<NoParams>({.name = "limits.get", .doc = "What the guard lets pass."},
                    [&engine](const NoParams&) { return engine.limits(); });
  rpc.add<LimitsChange>({.name = "limits.set",
                         .doc = "Sets the limits named; the others stay as they are. Not during a run.",
                         .role = Role::control,
                         .errors = {ErrorCode::busy, ErrorCode::bad_state}},
                        [&engine](const LimitsChange& change) {
                          auto named = write_json(change);
                          named.erase("reason");
                          engine.set_limits(named, change.reason);
                          return engine.limits();
                        });
  add_jobs(rpc, engine);
  add_leases(rpc, engine);
}

void add_all_methods(Dispatcher& rpc, Engine& engine) {
  add_all_methods(rpc, engine, std::make_shared<Queue>(engine));
}

void add_all_methods(Dispatcher& rpc, Engine& engine, const std::shared_ptr<Queue>& queue) {
  add_system_methods(rpc, engine);
  add_device_methods(rpc, engine);
  add_protocol_methods(rpc, engine);
  add_run_methods(rpc, engine, queue);
  add_queue_methods(rpc, queue);
  add_recording_methods(rpc, engine);
  add_import_method(rpc, engine);
  add_model_methods(rpc, engine);
  add_effect_methods(rpc);
  add_discrepancy_methods(rpc, engine);
  add_table_methods(rpc, engine);
  add_subscription_methods(rpc, engine.hub());
  add_discovery(rpc, engine.hub(), std::string(recordings::software_version()), method_examples());
  rpc.set_gate(
      [&engine](const Method& method, const CallContext& caller) { engine.lease().demand(method, caller); });
}

}  // namespace ferrobench::server
