#include "server/engine/engine.h"

#include <boost/uuid/random_generator.hpp>
#include <boost/uuid/uuid_io.hpp>

#include "daq/registry.h"
#include "daq/replay/tape.h"
#include "recordings/iso_time.h"
#include "server/engine/live.h"

namespace ferrobench::server {

namespace {

constexpr std::size_t most_runs = 1000;  // remembered, with their idempotency keys

Error no_such(const std::string& what, const std::string& given, const nlohmann::json& allowed) {
  return {ErrorCode::not_found, "there is no such " + what,
          Problem{.path = "/" + what,
                  .message = "is not known here",
                  .given = excerpt(given),
                  .allowed = allowed,
                  .hint = what + ".list names them"}};
}

}  // namespace

Engine::Engine(const std::filesystem::path& data_folder, Hub& hub)
    : hub_(hub), store_(data_folder), jobs_(hub) {
  hub.add_topic({.name = "run",
                 .doc = "status of the run: at each change of state, and five times a second",
                 .schema = json_schema<RunStatus>()});
  hub.add_topic(samples_topic());
  hub.add_topic(
      {.name = "events",
       .doc = "what the recording notes: limit trips, gaps, pauses, stops",
       .schema = {{"type", "object"},
                  {"properties",
                   {{"run", {{"type", "string"}, {"description", "absent if it concerns none"}}},
                    {"time", {{"type", "string"}, {"description", "ISO 8601"}}},
                    {"time_s", {{"type", "number"}, {"x-unit", "s"}, {"description", "in the run"}}},
                    {"kind", {{"type", "string"}}},
                    {"message", {{"type", "string"}}}}}}});
  hub.add_topic(
      {.name = "job", .doc = "status of a job when it changes", .schema = json_schema<JobStatus>()});
}

void Engine::stop() {
  std::shared_ptr<Run> run;
  {
    std::unique_lock lock(mutex_);
    stopped_ = true;
    test_stop_ = "the bench shuts down";
    test_over_.wait(lock, [this] { return tested_.empty(); });
    run = run_;
  }
  if (!run) return;
  run->abort("the bench shuts down");
  run->wait();
}

double Engine::uptime() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
}

RunStatus Engine::start(const RunRequest& request, const std::string& path) {
  Asked asked{.key = request.idempotency_key};
  if (!asked.key.empty()) asked.request = write_json(request);
  const std::unique_lock lock(mutex_);
  if (!asked.key.empty()) {
    const auto repeats = [&asked](const Asked& before) {
      if (before.key != asked.key) return false;
      if (before.request == asked.request) return true;
      throw Error(ErrorCode::invalid_params, "this idempotency key belongs to another request",
                  Problem{.path = "/idempotency_key",
                          .message = "was used for a different run",
                          .given = excerpt(asked.key),
                          .hint = "choose a new key for a new run"});
    };
    if (run_ && repeats(asked_)) return run_->status();
    for (const auto& [status, before] : past_)
      if (repeats(before)) return status;
  }
  demand_rest("no other starts");
  auto setup = make_setup(request);
  setup.path = path.empty() ? store_.new_recording(setup.plan.name).string() : path;
  if (run_) {
    run_->wait();  // its threads are done with the device, whoever still holds the run
    past_.emplace_front(run_->status(), std::move(asked_));
  }
  if (past_.size() > most_runs) {
    forgotten_.add(past_.back().first);
    past_.pop_back();
  }
  run_.reset();
  lease_.forget_lost();
  run_ = std::make_shared<Run>(std::move(setup), hub_);
  asked_ = std::move(asked);
  return run_->status();
}

// `mutex_` is held.
RunSetup Engine::make_setup(const RunRequest& request) const {
  RunSetup setup;
  setup.id = to_string(boost::uuids::random_generator()());
  setup.device_name = request.device;
  setup.limits = limits_;
  setup.notes = request.notes;
  setup.rerun_of = request.rerun_of;
  setup.stop_wanted = [this] { return lease_.lost(); };
  const auto name = replayed(request.device);
  if (const auto open = devices_.find(request.device); open != devices_.end()) {
    setup.device = open->second;
    const auto* tape = setup.device->tape();
    setup.plan =
        tape != nullptr ? make_replay_plan(request, *tape) : make_plan(request, store_, setup.device.get());
  } else if (name || request.device == "replay") {
    const auto file =
        request.replay_file.empty() ? store_.recording(name.value_or("")).string() : request.replay_file;
    setup.plan = make_replay_plan(request, file);
    setup.device = daq::open_device("replay", setup.plan.device_config);
    complete_replay_plan(setup.plan, *setup.device->tape());
  } else {
    setup.plan = make_plan(request, store_);
    setup.device = daq::open_device(request.device, setup.plan.device_config);
  }
  // A replay can wait for the disk, whatever its clock.
  setup.real_time = setup.device->tape() == nullptr && setup.device->info().value("clock", "real") != "fast";
  return setup;
}

void RunTotals::add(const RunStatus& run) {
  complete += run.state == RunState::complete ? 1 : 0;
  aborted += run.state == RunState::aborted ? 1 : 0;
  rows += run.rows;
  rows_on_disk += run.rows_on_disk;
}

RunTotals Engine::totals() const {
  const std::scoped_lock lock(mutex_);
  auto out = forgotten_;
  for (const auto& [status, asked] : past_) out.add(status);
  if (run_) out.add(run_->status());
  return out;
}

std::size_t Engine::queued_blocks() const {
  const std::scoped_lock lock(mutex_);
  return run_ ? run_->queued_blocks() : 0;
}

std::vector<RunStatus> Engine::runs() const {
  const std::scoped_lock lock(mutex_);
  std::vector<RunStatus> out;
  out.reserve(past_.size() + 1);
  if (run_) out.push_back(run_->status());
  for (const auto& [status, asked] : past_) out.push_back(status);
  return out;
}

RunStatus Engine::status(const std::string& id) const {
  const std::scoped_lock lock(mutex_);
  if (run_ && (id.empty() || run_->id() == id)) return run_->status();
  for (const auto& [status, asked] : past_)
    if (id.empty() || status.run == id) return status;
  if (id.empty()) return {};
  throw no_such("run", id, nullptr);
}

// The run under way or just over, by its id or as the latest.
std::shared_ptr<Run> Engine::current(const std::string& id) const {
  {
    const std::scoped_lock lock(mutex_);
    if (run_ && (id.empty() || run_->id() == id)) return run_;
  }
  const auto known = status(id);
  throw Error(ErrorCode::bad_state, known.run.empty() ? "there is no run" : "this run is over",
              Problem{.path = "/run", .message = "is not under way", .given = excerpt(id)});
}

RunStatus Engine::wait(const std::string& id) {
  const auto run = current(id);
  run->wait();
  return run->status();
}

void Engine::pause(const std::string& id) {
  current(id)->pause();
}

void Engine::resume(const std::string& id) {
  current(id)->resume();
}

void Engine::abort(const std::string& id, const std::string& reason) {
  if (id.empty()) {
    const std::scoped_lock lock(mutex_);
    if (!tested_.empty()) {
      test_stop_ = reason;
      return;
    }
  }
  const auto run = current(id);
  if (run->over())
    throw Error(ErrorCode::bad_state, "this run is over",
                Problem{.path = "/run", .message = "is not under way", .given = excerpt(id)});
  run->abort(reason);
}

bool Engine::is_being_written(const std::filesystem::path& path) const {
  const std::scoped_lock lock(mutex_);
  return run_ && !run_->over() && run_->status().path == path;
}

daq::Limits Engine::limits() const {
  const std::scoped_lock lock(mutex_);
  return limits_;
}

void Engine::demand_rest(const std::string& what) const {
  if (stopped_) throw Error(ErrorCode::bad_state, "the bench shuts down");
  if (run_ && !run_->over())
    throw Error(ErrorCode::busy, what + " while a run is under way",
                Problem{.given = run_->id(), .hint = "wait for its end, or run.abort it"});
  if (!tested_.empty())
    throw Error(ErrorCode::busy, what + " while a self-test is under way",
                Problem{.given = tested_, .hint = "wait for its end, or run.abort it"});
}

void Engine::demand_free(const std::string& device, const std::string& what) const {
  if (tested_ == device || (run_ && !run_->over() && run_->status().device == device)) demand_rest(what);
}

void Engine::set_limits(const nlohmann::json& named) {
  {
    const std::scoped_lock lock(mutex_);
    demand_rest("limits cannot change");
    auto all = write_json(limits_);
    all.update(named);
    limits_ = daq::limits_from_json(all);
  }
  hub_.publish("events",
               {{"time", recordings::iso_now()}, {"kind", "limits"}, {"message", "the limits were changed"}});
}

std::string Engine::open_device(const std::string& kind, const nlohmann::json& config) {
  constexpr std::size_t most_open = 8;
  auto full = config.is_null() ? nlohmann::json::object() : config;
  if (kind == "virtual" && full.is_object())
    full["model"] = resolve_model(full.value("model", nlohmann::json()), store_);
  // Recordings of the bench by their names: no client reads a file by its path.
  if (kind == "replay" && full.is_object() && full.contains("file") && full["file"].is_string())
    full["file"] = store_.recording(full["file"].get<std::string>()).string();
  auto device = daq::open_device(kind, full);
  const std::scoped_lock lock(mutex_);
  if (devices_.size() >= most_open)
    throw Error(ErrorCode::busy, "too many devices are open",
                Problem{.given = devices_.size(), .allowed = most_open, .hint = "device.close one"});
  auto id = kind + "-" + std::to_string(++last_device_);
  devices_[id] = std::move(device);
  return id;
}

std::shared_ptr<daq::Device> Engine::find_device(const std::string& id) const {
  if (const auto found = devices_.find(id); found != devices_.end()) return found->second;
  auto names = nlohmann::json::array();
  for (const auto& [name, device] : devices_) names.push_back(name);
  throw no_such("device", id, names);
}

void Engine::close_device(const std::string& id) {
  const std::scoped_lock lock(mutex_);
  find_device(id);
  demand_free(id, "the device cannot be closed");
  devices_.erase(id);
}

std::vector<std::string> Engine::open_devices() const {
  const std::scoped_lock lock(mutex_);
  std::vector<std::string> out;
  for (const auto& [name, device] : devices_) out.push_back(name);
  return out;
}

void Engine::with_device(const std::string& id, const std::function<void(daq::Device&)>& use) {
  const std::scoped_lock lock(mutex_);
  const auto device = find_device(id);
  demand_free(id, "the device is taken");
  use(*device);
}

daq::SelftestReport Engine::selftest(const std::string& id) {
  std::shared_ptr<daq::Device> device;
  {
    const std::scoped_lock lock(mutex_);
    device = find_device(id);
    demand_rest("no self-test starts");
    tested_ = id;
    test_stop_ = "";
    lease_.forget_lost();
  }
  // Whatever happens, the bench is free again after it.
  const std::unique_ptr<Engine, void (*)(Engine*)> over(this, [](Engine* engine) {
    const std::scoped_lock lock(engine->mutex_);
    engine->tested_ = "";
    engine->test_over_.notify_all();
  });
  return daq::selftest(*device, [this] {
    const std::scoped_lock lock(mutex_);
    return test_stop_.empty() ? lease_.lost() : test_stop_;
  });
}

}  // namespace ferrobench::server
