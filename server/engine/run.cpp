#include "server/engine/run.h"

#include <array>
#include <filesystem>

#include "base/visible.h"
#include "daq/replay/replay_source.h"
#include "daq/scaling.h"
#include "recordings/file/recover.h"
#include "recordings/format/iso_time.h"
#include "recordings/format/texts.h"
#include "server/engine/run_header.h"

namespace ferrobench::server {

namespace {

constexpr std::chrono::milliseconds status_interval{200};
constexpr std::chrono::milliseconds look_interval{12};  // half of what samples are shown by (live.h)
constexpr std::uint64_t most_shown = 8u << 20;  // bytes of the journal at a time; older ones are not shown
// A process that is started at this moment has the journal, and its lock, until it has become another
// program.
constexpr std::chrono::seconds journal_patience{5};

recordings::Recovery recover_recording_soon(const std::string& path) {
  const auto until = std::chrono::steady_clock::now() + journal_patience;
  for (;;) {
    auto done = recordings::recover_recording(path);
    if (done.outcome != recordings::Recovered::running || std::chrono::steady_clock::now() > until)
      return done;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

}  // namespace

std::span<const std::pair<RunState, std::string_view>> enum_names(RunState) {
  static constexpr std::array<std::pair<RunState, std::string_view>, 8> names{
      {{RunState::idle, "idle"},
       {RunState::arming, "arming"},
       {RunState::running, "running"},
       {RunState::pausing, "pausing"},
       {RunState::paused, "paused"},
       {RunState::stopping, "stopping"},
       {RunState::complete, "complete"},
       {RunState::aborted, "aborted"}}};
  return names;
}

std::span<const std::pair<RunEnding, std::string_view>> enum_names(RunEnding) {
  static constexpr std::array<std::pair<RunEnding, std::string_view>, 7> names{
      {{RunEnding::none, "none"},
       {RunEnding::complete, "complete"},
       {RunEnding::stopped, "stopped"},
       {RunEnding::limit, "limit"},
       {RunEnding::interlock, "interlock"},
       {RunEnding::fault, "fault"},
       {RunEnding::broken_off, "broken_off"}}};
  return names;
}

namespace {

RunEnding ending_of(daq::End end, const std::string& reason) {
  switch (end) {
    case daq::End::stopped:
      return bench::broke_off(reason) ? RunEnding::broken_off : RunEnding::stopped;
    case daq::End::limit:
      return RunEnding::limit;
    case daq::End::interlock:
      return RunEnding::interlock;
    case daq::End::none:
    case daq::End::complete:
    case daq::End::fault:
      break;
  }
  return RunEnding::fault;
}

}  // namespace

Run::Run(RunSetup setup, Hub& hub)
    : setup_(std::move(setup)),
      hub_(hub),
      link_(setup_.device->link()),
      number_(link_->new_number()),
      begin_(std::chrono::steady_clock::now()) {
  try {
    prepare();
  } catch (...) {
    link_->tell(bench::Drop{number_});
    throw;
  }
  tell();
  link_->watch(number_, this);
}

void Run::prepare() {
  const auto* replay = setup_.device->replay();
  bench::Prepare asked{.run = number_,
                       .device = setup_.device->number(),
                       .last_use = setup_.last_use,
                       .real_time = setup_.real_time,
                       .rate = setup_.plan.sample_rate,
                       .limits = setup_.limits};
  if (replay != nullptr) {
    const auto program = replay->program();
    asked.rate = program.rate();
    asked.exact_rate = true;
    asked.limits = replay->limits(setup_.limits);
    asked.program = bench::Program::of(program.waveform());
  } else {
    asked.program = bench::Program::of(setup_.plan.protocol.expand());
  }
  const auto prepared = link_->ask<bench::Prepared>(std::move(asked));
  rate_ = prepared.rate;
  last_.rows_expected = prepared.size;
  const daq::Scaling scaling(prepared.facts.columns, prepared.facts.signals, rate_);
  const recordings::Begin begin{header_of(setup_, prepared),
                                {scaling.channels().begin(), scaling.channels().end()},
                                {scaling.columns().begin(), scaling.columns().end()}};
  started_ = begin.header.start_time;
  while (!recording_) try {
      recording_.emplace(setup_.path, begin, setup_.existing);
    } catch (const recordings::NameTaken&) {
      if (!setup_.next_path) throw;
      setup_.path = setup_.next_path();
    }
  follower_.emplace(recording_->journal(), begin);
  live_.emplace(hub_, setup_.id);
  if (!setup_.notes.empty()) first_events_.push_back({0, "note", setup_.notes});
  if (prepared.distortion > 0.5 / rate_)
    first_events_.push_back({0, "stretched",
                             "the sample rate is too low for the program's corners: one of them is " +
                                 std::to_string(prepared.distortion) + " s late"});
}

// What another server needs to know of the run, should this one die.
std::string Run::card() const {
  return nlohmann::json{{"run", setup_.id},
                        {"protocol", setup_.plan.name},
                        {"title", setup_.plan.title},
                        {"device", setup_.device_name},
                        {"path", std::filesystem::absolute(setup_.path)},
                        {"replace", setup_.existing == recordings::Existing::replace},
                        {"rate", rate_},
                        {"real_time", setup_.real_time},
                        {"started", started_},
                        {"info", setup_.device->facts().info}}
      .dump();
}

Run::Run(std::shared_ptr<BenchLink> link, std::function<std::string()> stop_wanted, Hub& hub)
    : hub_(hub),
      link_(std::move(link)),
      number_(link_->ready().run),
      begin_(std::chrono::steady_clock::now()) {
  const auto card = nlohmann::json::parse(link_->ready().card);
  setup_.id = card.at("run");
  setup_.plan.name = card.at("protocol");
  setup_.plan.title = card.at("title");
  setup_.device_name = card.at("device");
  setup_.path = card.at("path");
  setup_.existing =
      card.at("replace").get<bool>() ? recordings::Existing::replace : recordings::Existing::keep;
  setup_.real_time = card.at("real_time");
  setup_.stop_wanted = std::move(stop_wanted);
  rate_ = card.at("rate");
  started_ = card.at("started");
  recording_.emplace(setup_.path, link_->take_journal(), setup_.existing);
  follower_.emplace(recording_->journal(), recording_->begin());
  live_.emplace(hub_, setup_.id);
  link_->watch(number_, this);
  link_->tell(bench::Attend{number_});
  {  // how far it is
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, std::chrono::seconds(1), [this] { return last_.rows_expected > 0; });
  }
  tell();
  begun_ = true;
  follower_thread_ = std::thread([this] { follow(); });
}

void Run::begin(const std::string& stopped) {
  if (!stopped.empty()) {
    asked_to_stop_ = true;
    link_->tell(bench::Stop{.run = number_, .reason = stopped});
  }
  const auto& protocol = setup_.plan.protocol;
  link_->tell(bench::Begin{.run = number_,
                           .path = recordings::journal_path(setup_.path),
                           .start_time = started_,
                           .events = std::move(first_events_),
                           .unattended = setup_.device->replay() == nullptr && protocol.unattended(),
                           .folder = setup_.folder,
                           .card = card()},
              recording_->journal());
  if (setup_.last_use) setup_.device->used_up();
  begun_ = true;
  follower_thread_ = std::thread([this] { follow(); });
}

Run::~Run() {
  if (begun_) {
    if (!over()) stop(bench::shuts_down);
    wait();
  } else {
    try {
      recording_->discard();
    } catch (const Error&) {  // the next recovery removes a journal without rows
    }
    link_->tell(bench::Drop{number_});
  }
  link_->watch(number_, nullptr);
}

void Run::wait() {
  const std::scoped_lock lock(joining_);
  if (follower_thread_.joinable()) follower_thread_.join();
}

void Run::status(const bench::RunState& state) {
  const std::scoped_lock lock(mutex_);
  last_ = state;
  changed_.notify_all();
}

void Run::event(const bench::Noted& event) {
  if (event.missed > 0)
    publish({event.event.time, "gap",
             std::to_string(event.missed) + " events went by unseen; the recording has them"});
  publish(event.event);
}

void Run::publish(const recordings::Event& event) {
  hub_.publish("events", {{"run", setup_.id},
                          {"time", recordings::iso_now()},
                          {"time_s", event.time},
                          {"kind", event.kind},
                          {"message", event.message}});
}

void Run::closed(const bench::Closed& closed) {
  const std::scoped_lock lock(mutex_);
  last_ = closed.state;
  closed_ = closed;
  changed_.notify_all();
}

// Told by the link, and by whoever asked something of the bench meanwhile.
void Run::lost(const std::string& why) {
  const std::scoped_lock one_at_a_time(losing_);
  {
    const std::scoped_lock lock(mutex_);
    if (closed_ || lost_) return;  // the run had ended, and all of it has come; or this is known
  }
  publish({0, "fault", why});
  const std::scoped_lock lock(mutex_);
  lost_ = why;
  if (reason_.empty()) reason_ = why;
  changed_.notify_all();
}

void Run::show() {
  if (setup_.watch || hub_.wanted("samples"))
    follower_->next(most_shown, [this](const recordings::Columns& columns) {
      if (setup_.watch) setup_.watch(columns.rows());
      live_->add(columns.rows());
    });
  else
    follower_->pass_over();
}

void Run::follow() {
  auto shown = std::chrono::steady_clock::now() - status_interval;
  auto state = RunState::idle;
  bool stopped = false;
  std::unique_lock lock(mutex_);
  while (!closed_ && !lost_) {
    lock.unlock();
    if (setup_.stop_wanted && !stopped)
      if (const auto reason = setup_.stop_wanted(); !reason.empty()) {
        stopped = true;
        link_->tell(bench::Stop{.run = number_, .reason = reason});
      }
    show();
    const auto now = std::chrono::steady_clock::now();
    const auto now_in = status().state;
    if (now_in != state || now - shown >= status_interval) {
      state = now_in;
      shown = now;
      tell();
    }
    lock.lock();
    if (!closed_ && !lost_) changed_.wait_for(lock, look_interval);
  }
  const auto closed = closed_;
  const auto why = lost_.value_or("");
  lock.unlock();
  tell();
  show();
  live_->finish();
  if (closed)
    finish(*closed);
  else
    recover(why);
  follower_.reset();
  recording_.reset();
  link_->tell(bench::Drop{number_});
  tell();
}

void Run::finish(const bench::Closed& closed) {
  auto ending = recordings::ending_of(closed.ending);
  std::string reason = ending.reason;
  const bool complete = ending.status == "complete";
  // A replay played whole is a complete run, of a recording that may be anything.
  const auto* replay = setup_.device ? setup_.device->replay() : nullptr;
  if (replay != nullptr && closed.failure.empty() && closed.state.end != daq::End::none) {
    auto as = replay->closing(closed.state.end, reason, closed.played, closed.state.rows);
    ending.status = std::move(as.status);
    ending.reason = std::move(as.reason);
    ending.segments = std::move(as.segments);
  }
  std::string failure = closed.failure;
  const bool recorded = closed.rows > 0;
  try {  // also after a failure: what was written before it is a recording
    if (recorded)
      recording_->finish(ending, closed.rows);
    else
      recording_->discard();
  } catch (const std::exception& error) {
    if (failure.empty()) failure = "the recording's file cannot be made: " + in_one_line(error.what());
  }
  if (!failure.empty()) reason = failure;
  setup_.device.reset();  // who is told of the end may open it
  const std::scoped_lock lock(mutex_);
  if (failure.empty()) last_.rows_on_disk = closed.rows;
  at_zero_ = closed.state.output_at_zero;
  warning_ = closed.state.warning;
  const bool whole = complete && failure.empty();
  end(whole              ? RunEnding::complete
      : !failure.empty() ? RunEnding::fault
                         : ending_of(closed.state.end, reason),
      reason, recorded);
}

// The bench died, and whatever may hold a voltage is brought to zero by its successor.
void Run::recover(const std::string& why) {
  const auto warning = link_->after_loss();
  setup_.device.reset();
  bool recorded = true;
  std::string reason = why;
  recording_.reset();  // and the lock with them
  follower_.reset();
  std::optional<std::uint64_t> rows;
  try {
    const auto done = recover_recording_soon(setup_.path);
    if (done.outcome == recordings::Recovered::running)
      throw Error(ErrorCode::busy, "its journal is still in use; 'ferrobench recover' makes the file of it");
    recorded = done.outcome != recordings::Recovered::nothing;
    rows = done.rows;
  } catch (const std::exception& error) {
    reason += "; the recording's file cannot be made: " + in_one_line(error.what());
  }
  const std::scoped_lock lock(mutex_);
  if (rows) last_.rows = last_.rows_on_disk = *rows;
  at_zero_ = warning.empty();
  warning_ = warning;
  end(RunEnding::broken_off, reason, recorded);
}

void Run::end(RunEnding ending, const std::string& reason, bool recorded) {
  state_ = ending == RunEnding::complete ? RunState::complete : RunState::aborted;
  ending_ = ending;
  reason_ = reason;
  ended_ = recordings::iso_now();
  recorded_ = recorded;
}

void Run::tell() {
  const std::scoped_lock lock(telling_);
  hub_.publish("run", write_json(status()));
}

std::size_t Run::queued_blocks() const {
  const std::scoped_lock lock(mutex_);
  return last_.blocks_waiting;
}

bool Run::output_at_zero() const {
  const std::scoped_lock lock(mutex_);
  return is_over(state_) ? at_zero_ : last_.output_at_zero;
}

bool Run::over() const {
  const std::scoped_lock lock(mutex_);
  return is_over(state_);
}

RunStatus Run::status() const {
  using Guarded = daq::Progress::State;
  const std::scoped_lock lock(mutex_);
  const auto& guarded = last_;
  RunStatus out{.run = setup_.id,
                .protocol = setup_.plan.name,
                .title = setup_.plan.title,
                .device = setup_.device_name,
                .recording = std::filesystem::path(setup_.path).stem(),
                .path = setup_.path,
                .rows = static_cast<std::int64_t>(guarded.rows),
                .rows_on_disk = static_cast<std::int64_t>(guarded.rows_on_disk),
                .rows_expected = static_cast<std::int64_t>(guarded.rows_expected),
                .queue_used = std::min(1.0, static_cast<double>(guarded.most_waiting) / bench::queue_blocks),
                .sample_rate = rate_,
                .started = started_,
                .output_at_zero = false};
  out.duration = static_cast<double>(out.rows_expected) / out.sample_rate;
  out.progress = std::min(
      1.0, static_cast<double>(out.rows) / static_cast<double>(std::max<std::int64_t>(out.rows_expected, 1)));
  out.state = state_;
  out.ending = ending_;
  out.reason = reason_;
  out.ended = ended_;
  if (is_over(state_)) {
    out.output_at_zero = at_zero_;
    out.warning = warning_;
    if (!recorded_) out.recording = out.path = "";
    return out;
  }
  if (lost_) {
    out.state = RunState::stopping;
    return out;
  }
  switch (guarded.guard) {
    case Guarded::idle:
      out.state = RunState::arming;
      break;
    case Guarded::running:
      out.state = RunState::running;
      break;
    case Guarded::pausing:
      out.state = RunState::pausing;
      break;
    case Guarded::paused:
      out.state = RunState::paused;
      break;
    case Guarded::stopping:
      out.state = RunState::stopping;
      break;
    case Guarded::ended:  // the file is not whole yet
      out.state = guarded.end == daq::End::complete ? RunState::running : RunState::stopping;
      break;
  }
  const auto left = static_cast<double>(out.rows_expected - out.rows);
  if (setup_.real_time) {
    out.time_left = left / out.sample_rate;
  } else if (out.rows > 0) {
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin_;
    out.time_left = spent.count() / static_cast<double>(out.rows) * left;
  }
  return out;
}

void Run::pause() {
  link_->order(bench::Pause{.run = number_});
  tell();
}

void Run::resume() {
  link_->order(bench::Resume{.run = number_});
  tell();
}

void Run::abort(const std::string& reason, bool again) {
  const bool before = asked_to_stop_.exchange(true);
  stop(reason);  // the second time, too: the one that was first may not have reached the bench yet
  if (before && !again) hasten();
}

// A bench that does not take it has died or is over, and its run with it. That it has died is known before
// anybody is answered.
template <class M>
void Run::order_at_once(const M& order) {
  try {
    link_->order_at_once(order);
  } catch (const Error& failure) {
    if (link_->lost()) lost(failure.message());
  }
  tell();
}

void Run::stop(const std::string& reason) {
  order_at_once(bench::Stop{.run = number_, .reason = reason});
}

void Run::hasten() {
  order_at_once(bench::Hasten{.run = number_});
}

}  // namespace ferrobench::server
