#include "server/engine/engine.h"

#include <boost/uuid/random_generator.hpp>
#include <boost/uuid/uuid_io.hpp>

#include "recordings/file/recover.h"
#include "recordings/format/iso_time.h"
#include "server/engine/live.h"

namespace ferrobench::server {

namespace {

constexpr std::size_t most_runs = 1000;  // remembered, with their idempotency keys
// On a busy machine a bench process may take so long to see that its server has died, or to die with it. Its
// recording stays locked meanwhile.
constexpr std::chrono::seconds bench_patience{5};

bool is_written(const std::vector<std::string>& journals) {
  return std::ranges::any_of(journals, [](const std::string& path) {
    return recordings::journal_state(path) == recordings::JournalState::being_written;
  });
}

// Does it however the scope is left.
template <class F>
struct AtEnd {
  F act;
  explicit AtEnd(F f) : act(std::move(f)) {}
  ~AtEnd() { act(); }
  AtEnd(const AtEnd&) = delete;
  AtEnd& operator=(const AtEnd&) = delete;
};

Error no_such(const std::string& what, const std::string& given, const nlohmann::json& allowed) {
  return {ErrorCode::not_found, "there is no such " + what,
          Problem{.path = "/" + what,
                  .message = "is not known here",
                  .given = excerpt(given),
                  .allowed = allowed,
                  .hint = what + ".list names them"}};
}

}  // namespace

Engine::Engine(const std::filesystem::path& data_folder, Hub& hub, DeviceOpener opener)
    : hub_(hub), store_(data_folder), benches_(std::move(opener), hazards_), jobs_(hub) {
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
  hub.add_topic({.name = "queue",
                 .doc = "what the queue does, when that or its items have changed; queue.list has them",
                 .schema = {{"type", "object"},
                            {"properties",
                             {{"state", {{"type", "string"}}},
                              {"reason", {{"type", "string"}}},
                              {"item", {{"type", "integer"}}},
                              {"confirm", {{"type", "string"}}}}}}});
  hub.add_topic(
      {.name = "job", .doc = "status of a job when it changes", .schema = json_schema<JobStatus>()});
}

void Engine::stop() {
  std::shared_ptr<Run> run;
  {
    Lock lock(mutex_);
    stopped_ = true;
    test_stop_ = bench::shuts_down;
    if (preparing_ && preparing_->status.reason.empty()) preparing_->status.reason = bench::shuts_down;
    changed_.wait(lock, [this] { return tested_.empty() && !preparing_; });
    run = run_;
  }
  if (!run) return;
  run->stop(bench::shuts_down);
  run->wait();
}

std::string Engine::take_over() {
  takes_over_ = true;
  const auto folder = store_.folder().string();
  auto link = benches_.take_over(folder);
  const auto journals = link ? std::vector<std::string>() : recordings::find_broken(folder);
  for (const auto until = std::chrono::steady_clock::now() + bench_patience;
       !link && is_written(journals) && std::chrono::steady_clock::now() < until;) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    link = benches_.take_over(folder);
  }
  if (!link) return "";
  std::shared_ptr<Run> run;
  try {
    run = std::make_shared<Run>(
        link, [this] { return lease_.lost(); }, hub_);
  } catch (...) {  // nobody would watch it
    link->tell(
        bench::Stop{.run = link->ready().run, .reason = "the next server can make nothing of the run"});
    throw;
  }
  const auto status = run->status();
  const std::scoped_lock lock(mutex_);
  run_ = std::move(run);
  return "the bench process " + std::to_string(link->ready().process) + " had lost its server: its run " +
         status.recording + " is " + write_json(status.state).get<std::string>();
}

bool Engine::output_at_zero() const {
  const std::scoped_lock lock(mutex_);
  return run_ && run_->output_at_zero();
}

double Engine::uptime() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
}

// The run that this was asked for before, once it is known whether that one came to be.
std::optional<RunStatus> Engine::repeated(const Asked& asked, Lock& lock) {
  if (asked.key.empty()) return std::nullopt;
  changed_.wait(lock, [&] { return !preparing_ || preparing_->asked.key != asked.key; });
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
  return std::nullopt;
}

RunStatus Engine::start(const RunRequest& request, const std::string& path) {
  Asked asked{.key = request.idempotency_key};
  if (!asked.key.empty()) asked.request = write_json(request);
  RunSetup setup{.id = request.id.empty() ? to_string(boost::uuids::random_generator()()) : request.id,
                 .device_name = request.device};
  setup.identifier = setup.id;
  std::shared_ptr<Run> before;
  std::shared_ptr<HeldDevice> open;
  {
    Lock lock(mutex_);
    if (auto run = repeated(asked, lock)) return *run;
    demand_rest("no other starts");
    if (request.last_word) request.last_word();
    lease_.forget_lost();
    preparing_ = {.status = {.run = setup.id,
                             .state = RunState::arming,
                             .protocol = request.protocol.is_string() ? request.protocol.get<std::string>()
                                                                      : text_at(request.protocol, "name"),
                             .device = request.device,
                             .started = recordings::iso_now(),
                             .output_at_zero = false},
                  .asked = std::move(asked)};
    setup.limits = limits_;
    before = run_;
    if (const auto at = devices_.find(request.device); at != devices_.end()) {
      changed_.wait(lock, [&] { return !at->second.used; });
      open = at->second.device;
    }
  }
  const AtEnd failed([this, id = setup.id] {
    const std::scoped_lock lock(mutex_);
    if (!preparing_ || preparing_->status.run != id) return;  // it went well
    preparing_.reset();
    changed_.notify_all();
  });
  if (before) before->wait();  // its threads are done with the device, whoever still holds the run
  setup = make_setup(request, std::move(setup), std::move(open));
  setup.existing = request.existing;
  if (path.empty())
    setup.next_path = [this, name = setup.plan.name] { return store_.new_recording(name).string(); };
  setup.path = path.empty() ? setup.next_path() : path;
  auto run = std::make_shared<Run>(std::move(setup), hub_);

  const std::scoped_lock lock(mutex_);
  if (run_) past_.emplace_front(run_->status(), std::move(asked_));
  if (past_.size() > most_runs) {
    forgotten_.add(past_.back().first);
    past_.pop_back();
  }
  run_ = std::move(run);
  asked_ = std::move(preparing_->asked);
  run_->begin(preparing_->status.reason);
  preparing_.reset();
  changed_.notify_all();
  return run_->status();
}

RunSetup Engine::make_setup(const RunRequest& request, RunSetup setup, std::shared_ptr<HeldDevice> open) {
  setup.notes = request.notes;
  setup.rerun_of = request.rerun_of;
  setup.watch = request.watch;
  setup.stop_wanted = [this, own = request.stop_wanted] {
    auto reason = lease_.lost();
    return reason.empty() && own ? own() : reason;
  };
  if (takes_over_) setup.folder = std::filesystem::absolute(store_.folder()).string();
  setup.last_use = open == nullptr;
  const auto name = replayed(request.device);
  if (open) {
    setup.device = std::move(open);
    const auto* replay = setup.device->replay();
    setup.plan = replay != nullptr ? make_replay_plan(request, *replay)
                                   : make_plan(request, store_, &setup.device->look());
  } else if (name || request.device == "replay") {
    const auto file =
        request.replay_file.empty() ? store_.recording(name.value_or("")).string() : request.replay_file;
    setup.plan = make_replay_plan(request, file);
    setup.device = benches_.open("replay", setup.plan.device_config);
    complete_replay_plan(setup.plan, *setup.device->replay());
  } else {
    setup.plan = make_plan(request, store_);
    setup.device = benches_.open(request.device, setup.plan.device_config);
  }
  // A replay can wait for the disk, whatever its clock.
  setup.real_time =
      setup.device->replay() == nullptr && setup.device->facts().info.value("clock", "real") != "fast";
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
  if (id.empty()) {
    auto out = latest();
    if (const auto text = hazards_.text(); !text.empty()) {
      out.output_at_zero = false;
      out.warning += (out.warning.empty() ? "" : "; ") + text;
    }
    return out;
  }
  const std::scoped_lock lock(mutex_);
  if (preparing_ && preparing_->status.run == id) return preparing_->status;
  if (run_ && run_->id() == id) return run_->status();
  for (const auto& [status, asked] : past_)
    if (status.run == id) return status;
  throw no_such("run", id, nullptr);
}

RunStatus Engine::latest() const {
  const std::scoped_lock lock(mutex_);
  if (preparing_) return preparing_->status;
  if (run_) return run_->status();
  return past_.empty() ? RunStatus{} : past_.front().first;
}

// The run under way or just over, by its id or as the latest.
std::shared_ptr<Run> Engine::current(const std::string& id) const {
  {
    const std::scoped_lock lock(mutex_);
    if (preparing_ && (id.empty() || preparing_->status.run == id))
      throw Error(ErrorCode::bad_state, "this run is still being prepared",
                  Problem{.path = "/run", .given = excerpt(id), .hint = "run.abort stops it already"});
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

RunStatus Engine::pause(const std::string& id) {
  const auto run = current(id);
  run->pause();
  return run->status();
}

RunStatus Engine::resume(const std::string& id) {
  const auto run = current(id);
  run->resume();
  return run->status();
}

RunStatus Engine::abort(const std::string& id, const std::string& reason, bool again) {
  {
    const std::scoped_lock lock(mutex_);
    if (id.empty() && !tested_.empty()) {
      test_stop_ = reason;
      return run_ ? run_->status() : RunStatus{};
    }
    if (preparing_ && (id.empty() || preparing_->status.run == id)) {
      if (preparing_->status.reason.empty()) preparing_->status.reason = reason;
      return preparing_->status;
    }
  }
  const auto run = current(id);
  if (run->over())
    throw Error(ErrorCode::bad_state, "this run is over",
                Problem{.path = "/run", .message = "is not under way", .given = excerpt(id)});
  run->abort(reason, again);
  return run->status();
}

void Engine::hasten() {
  std::shared_ptr<Run> run;
  {
    const std::scoped_lock lock(mutex_);
    run = run_;
  }
  if (run && !run->over()) run->hasten();
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
  if (stopped_) throw Error(ErrorCode::bad_state, bench::shuts_down);
  if (preparing_)
    throw Error(ErrorCode::busy, what + " while a run is being prepared",
                Problem{.given = preparing_->status.run, .hint = "wait for its end, or run.abort it"});
  if (run_ && !run_->over())
    throw Error(ErrorCode::busy, what + " while a run is under way",
                Problem{.given = run_->id(), .hint = "wait for its end, or run.abort it"});
  if (!tested_.empty())
    throw Error(ErrorCode::busy, what + " while a self-test is under way",
                Problem{.given = tested_, .hint = "wait for its end, or run.abort it"});
}

void Engine::demand_free(const std::string& device, const std::string& what) const {
  if (tested_ == device || (preparing_ && preparing_->status.device == device) ||
      (run_ && !run_->over() && run_->status().device == device))
    demand_rest(what);
}

void Engine::set_limits(const nlohmann::json& named, const std::string& reason) {
  {
    const std::scoped_lock lock(mutex_);
    demand_rest("limits cannot change");
    auto all = write_json(limits_);
    all.update(named);
    const auto limits = daq::limits_from_json(all);
    if (limits.stop_time > daq::usual_stop_time && limits.stop_time != limits_.stop_time && reason.empty())
      throw Error(ErrorCode::invalid_params, "a stop that takes longer than usual wants a reason",
                  Problem{.path = "/reason",
                          .message = "is missing",
                          .given = limits.stop_time,
                          .allowed = {{"to", daq::usual_stop_time}},
                          .unit = "s",
                          .hint = "say what keeps the amplifier from going faster, or lower stop_time"});
    limits_ = limits;
  }
  hub_.publish("events", {{"time", recordings::iso_now()},
                          {"kind", "limits"},
                          {"message", "the limits were changed" + (reason.empty() ? "" : ": " + reason)}});
}

std::string Engine::open_device(const std::string& kind, const nlohmann::json& config) {
  constexpr std::size_t most_open = 8;
  auto full = config.is_null() ? nlohmann::json::object() : config;
  if (kind == "virtual" && full.is_object())
    full["model"] = resolve_model(full.value("model", nlohmann::json()), store_);
  // Recordings of the bench by their names: no client reads a file by its path.
  if (kind == "replay" && full.is_object() && full.contains("file") && full["file"].is_string())
    full["file"] = store_.recording(full["file"].get<std::string>()).string();
  auto device = benches_.open(kind, full);  // closed without the lock where it is refused
  const std::scoped_lock lock(mutex_);
  if (devices_.size() >= most_open)
    throw Error(ErrorCode::busy, "too many devices are open",
                Problem{.given = devices_.size(), .allowed = most_open, .hint = "device.close one"});
  auto id = kind + "-" + std::to_string(++last_device_);
  devices_[id].device = std::move(device);
  return id;
}

Engine::Open& Engine::find_device(const std::string& id) {
  if (const auto found = devices_.find(id); found != devices_.end()) return found->second;
  auto names = nlohmann::json::array();
  for (const auto& [name, device] : devices_) names.push_back(name);
  throw no_such("device", id, names);
}

Engine::Open& Engine::free_device(const std::string& id, const std::string& what, Lock& lock) {
  for (;; changed_.wait(lock)) {
    auto& device = find_device(id);
    demand_free(id, what);
    if (!device.used) return device;
  }
}

void Engine::close_device(const std::string& id) {
  std::shared_ptr<HeldDevice> closed;  // without the lock
  Lock lock(mutex_);
  closed = std::move(free_device(id, "the device cannot be closed", lock).device);
  devices_.erase(id);
  const double slew = limits_.stop_slew;
  lock.unlock();
  try {
    closed->close(slew);
  } catch (const Error& failure) {
    hazards_.add(text_at(closed->facts().info, "serial_number"), failure.message());
    throw;
  }
}

std::vector<std::string> Engine::open_devices() const {
  const std::scoped_lock lock(mutex_);
  std::vector<std::string> out;
  for (const auto& [name, device] : devices_) out.push_back(name);
  return out;
}

void Engine::with_device(const std::string& id, const std::function<void(const daq::DeviceFacts&)>& use) {
  Lock lock(mutex_);
  auto& open = free_device(id, "the device is taken", lock);  // stays where it is while it is used
  open.used = true;
  lock.unlock();
  const AtEnd over([&] {
    const std::scoped_lock again(mutex_);
    open.used = false;
    changed_.notify_all();
  });
  use(open.device->look());
}

daq::SelftestReport Engine::selftest(const std::string& id, double rate) {
  std::shared_ptr<HeldDevice> device;
  {
    Lock lock(mutex_);
    find_device(id);
    demand_rest("no self-test starts");
    device = free_device(id, "no self-test starts", lock).device;
    demand_rest("no self-test starts");
    tested_ = id;
    test_stop_ = "";
    lease_.forget_lost();
  }
  const AtEnd over([this] {
    const std::scoped_lock lock(mutex_);
    tested_ = "";
    changed_.notify_all();
  });
  return device->selftest(rate, [this] {
    const std::scoped_lock lock(mutex_);
    return test_stop_.empty() ? lease_.lost() : test_stop_;
  });
}

}  // namespace ferrobench::server
