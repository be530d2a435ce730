#include "server/queue/queue.h"

#include <array>
#include <boost/uuid/random_generator.hpp>
#include <boost/uuid/uuid_io.hpp>

#include "base/visible.h"
#include "daq/guard/check.h"
#include "daq/registry.h"
#include "recordings/file/reader.h"
#include "recordings/file/recover.h"
#include "server/bench/host.h"

namespace ferrobench::server {

using nlohmann::json;

namespace {

constexpr std::chrono::milliseconds look_again{200};  // whether the bench is free

std::string protocol_name(const Plan& plan) {
  const auto name = text_at(plan.run.request.protocol, "name");
  return name.empty() ? "replay" : name;
}

std::string in_quotes(const std::string& text) {
  return '"' + text + '"';
}

// What the engine says of one run, said of the plan.
Error in_plan(const Error& error, const Plan& plan) {
  auto problems = error.problems();
  for (auto& p : problems) {
    std::string place = "/run" + p.path;
    if (error.code() == ErrorCode::bad_protocol || error.code() == ErrorCode::limit_exceeded)
      place = "/run/protocol" + p.path;
    if (error.code() == ErrorCode::bad_model) place = "/run/model" + p.path;
    for (std::size_t i = 0; i < plan.sweeps.size(); ++i)
      if (p.path == "/set/" + plan.sweeps[i].set) place = "/sweeps/" + std::to_string(i);
    p.path = place;
  }
  return {error.code(), error.message(), std::move(problems)};
}

}  // namespace

std::span<const std::pair<QueueActivity, std::string_view>> enum_names(QueueActivity) {
  static constexpr std::array<std::pair<QueueActivity, std::string_view>, 4> names{
      {{QueueActivity::stopped, "stopped"},
       {QueueActivity::running, "running"},
       {QueueActivity::asks, "asks"},
       {QueueActivity::waits, "waits"}}};
  return names;
}

Ledger& Queue::ledger() {
  std::call_once(opened_, [this] { ledger_ = std::make_unique<Ledger>(engine_.store().folder()); });
  return *ledger_;
}

std::string Queue::open() {
  const auto before = ledger().state();
  {
    const std::scoped_lock lock(mutex_);
    started_ = before.started;
    resumed_ = true;
    reason_ = before.reason;
    doing_ = {.state = QueueActivity::waits};
  }
  std::string found;
  for (const auto& entry : ledger().running()) {
    const auto& item = entry.item;
    found += (found.empty() ? "" : "; ") + ("item " + std::to_string(item.item) + " of the queue ");
    try {
      engine_.status(item.run);
      const std::scoped_lock lock(mutex_);
      taken_over_.emplace(entry, item.run);
      found += "is followed to its end";
      continue;
    } catch (const Error& unknown) {
      if (unknown.code() != ErrorCode::not_found) throw;
    }
    const auto outcome = outcome_of_recording(item.run, item.recording);
    settle(entry, item.run, outcome);
    found += "was under way; it is " + write_json(ledger().entry(item.item).item.state).get<std::string>() +
             (outcome.reason.empty() ? "" : ": " + outcome.reason);
  }
  thread_ = std::thread([this] { work(); });
  saver_ = std::thread([this] { keep_saved(); });
  return found;
}

void Queue::close() {
  const std::scoped_lock lock(mutex_);
  ending_ = true;
  changed_.notify_all();
}

void Queue::end() {
  close();
  if (thread_.joinable()) thread_.join();
  {
    const std::scoped_lock lock(mutex_);
    ended_ = true;
    changed_.notify_all();
  }
  if (saver_.joinable()) saver_.join();
}

void Queue::touch() {
  const std::scoped_lock lock(mutex_);
  ++version_;
  changed_.notify_all();
}

void Queue::show() {
  engine_.hub().publish("queue", write_json(status()));
}

QueueStatus Queue::status() const {
  const std::scoped_lock lock(mutex_);
  if (started_) return doing_;
  return {.state = QueueActivity::stopped,
          .reason = reason_,
          .item = doing_.state == QueueActivity::running ? doing_.item : 0};
}

void Queue::check(const Plan& plan) const {
  const auto& device = plan.run.request.device;
  const auto open = engine_.open_devices();
  const bool known = std::ranges::count(open, device) > 0;  // what it is can change until then
  if (!known && !replayed(device)) daq::device_kind(device);
  const auto limits = engine_.limits();
  for (const auto& step : steps_of(plan)) {
    const auto request = request_of(plan, step);
    if (const auto name = replayed(device)) {
      make_replay_plan(request, engine_.store().recording(*name).string());
      continue;
    }
    if (known) {
      resolve_protocol(request.protocol, &engine_.store());
      return;
    }
    const auto made = make_plan(request, engine_.store());
    const auto waveform = made.protocol.expand();
    const protocols::SampledWaveform program(
        waveform, std::max(made.sample_rate, waveform.fastest_recorded()), made.sample_rate);
    if (auto problems = daq::check(program, limits); !problems.empty())
      throw Error(ErrorCode::limit_exceeded, "a run of the plan goes beyond a limit", std::move(problems));
  }
}

Ledger::Added Queue::add(Plan plan) {
  auto& request = plan.run.request;
  try {  // what is run at night is what was added, whatever gets these names until then
    if (request.protocol.is_string())
      request.protocol = resolve_protocol(request.protocol, &engine_.store()).json();
    if (request.model.is_string()) request.model = resolve_model(request.model, engine_.store());
    check(plan);
  } catch (const Error& refused) {
    throw in_plan(refused, plan);
  }
  if (plan.name.empty()) plan.name = protocol_name(plan);
  const auto added = ledger().add(plan);
  touch();
  show();
  return added;
}

Ledger::Page Queue::list(std::int64_t plan, std::optional<ItemState> state, std::int64_t first,
                         std::int64_t count) {
  return ledger().list(plan, state, first, count);
}

std::int64_t Queue::move(ItemChoice which, std::optional<std::int64_t> before, bool first) {
  const auto moved = ledger().move(which, before, first);
  touch();
  show();
  return moved;
}

std::int64_t Queue::remove(ItemChoice which) {
  const auto removed = ledger().remove(which);
  touch();
  show();
  return removed;
}

QueueStatus Queue::start() {
  if (!thread_.joinable())
    throw Error(ErrorCode::bad_state, "the queue runs in the daemon",
                Problem{.message = "no daemon is running", .hint = "start one with 'ferrobench serve'"});
  if (!ledger().next())
    throw Error(ErrorCode::bad_state, "nothing waits in the queue",
                Problem{.hint = "queue.add something first"});
  {
    const std::scoped_lock saving(saving_);
    ledger().confirm_plans();
    ledger().set_state({.started = true});
    const std::scoped_lock lock(mutex_);
    if (!started_ && doing_.state != QueueActivity::running) doing_ = {.state = QueueActivity::waits};
    started_ = true;
    resumed_ = unsaved_ = false;
    reason_.clear();
  }
  touch();
  show();
  return status();
}

bool Queue::halt(const std::string& reason, std::optional<std::uint64_t> seen) {
  const std::scoped_lock lock(mutex_);
  if (!started_ || seen.value_or(version_) != version_) return false;
  started_ = false;
  unsaved_ = true;
  reason_ = reason;
  ++version_;
  changed_.notify_all();
  return true;
}

QueueStatus Queue::stop(const std::string& reason) {
  if (halt(reason)) save();
  show();
  return status();
}

// By the queue's own thread, or before it began.
void Queue::come_to_rest(const std::string& reason, HookEvent event, std::optional<std::uint64_t> seen) {
  if (!halt(reason, seen)) return;
  show();
  tell(event, {{"reason", reason}});
}

void Queue::tell(HookEvent event, const json& facts) {
  if (hooks_) hooks_->tell(event, facts);
}

void Queue::save() {
  const std::scoped_lock saving(saving_);
  Ledger::State state;
  {
    const std::scoped_lock lock(mutex_);
    state = {.started = started_, .reason = reason_};
    unsaved_ = false;
  }
  ledger().set_state(state);
}

QueueStatus Queue::confirm(std::int64_t item) {
  const auto entry = ledger().entry(item);
  {
    const std::scoped_lock lock(mutex_);
    if (!started_ || doing_.state != QueueActivity::asks || doing_.item != item)
      throw Error(ErrorCode::bad_state, "this item asks for nothing now",
                  Problem{.path = "/item",
                          .message = "does not wait for a confirmation",
                          .given = item,
                          .hint = "queue.list says what the queue waits for"});
    doing_ = {.state = QueueActivity::waits};
  }
  ledger().set_up(entry.item.plan, setup_of(*entry.plan, entry.step));
  touch();
  show();
  return status();
}

void Queue::work() {
  for (;;) {
    std::uint64_t seen = 0;
    std::optional<std::pair<Ledger::Entry, std::string>> taken_over;
    {
      Lock lock(mutex_);
      changed_.wait(lock, [this] { return ending_ || taken_over_ || started_; });
      if (ending_ && !taken_over_) return;
      taken_over = std::exchange(taken_over_, std::nullopt);
      seen = version_;
    }
    try {
      if (taken_over)
        follow(taken_over->first, taken_over->second);
      else
        step(seen);
    } catch (const std::exception& failure) {  // of the disk: what is known stays in memory
      come_to_rest(in_one_line(failure.what()));
    }
  }
}

// That somebody has stopped the queue is on the disk before the run under way has come to its end: a daemon
// that died meanwhile must not go on by itself.
void Queue::keep_saved() {
  constexpr std::chrono::seconds again{1};  // after a disk has refused it
  Lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [this] { return unsaved_ || ended_; });
    if (!unsaved_) return;
    lock.unlock();
    bool saved = true;
    try {
      save();
      show();
    } catch (const std::exception&) {
      saved = false;
    }
    lock.lock();
    if (saved) continue;
    unsaved_ = true;
    if (changed_.wait_for(lock, again, [this] { return ended_; })) return;
  }
}

void Queue::wait(std::uint64_t seen, QueueStatus meanwhile, std::optional<std::chrono::milliseconds> most) {
  bool news = false;
  {
    const std::scoped_lock lock(mutex_);
    if (version_ != seen || !started_) return;
    news = doing_ != meanwhile;
    doing_ = std::move(meanwhile);
  }
  if (news) show();
  Lock lock(mutex_);
  const auto over = [&] { return ending_ || version_ != seen; };
  if (most)
    changed_.wait_for(lock, *most, over);
  else
    changed_.wait(lock, over);
}

void Queue::step(std::uint64_t seen) {
  const auto next = ledger().next();
  if (!next) return come_to_rest("the queue is empty", HookEvent::queue_empty, seen);
  bool resumed = false;
  {
    const std::scoped_lock lock(mutex_);
    resumed = resumed_;
  }
  if (resumed) {
    if (next->plan->rules.resume != Resume::automatic || !next->confirmed)
      return come_to_rest("the daemon was restarted, and " + in_quotes(next->item.name) +
                          " does not go on by itself");
    if (const auto hazard = engine_.hazards().text(); !hazard.empty()) return come_to_rest(hazard);
  }
  if (auto text = to_confirm(*next->plan, next->step, next->set_up); !text.empty())
    return wait(seen, {.state = QueueActivity::asks, .item = next->item.item, .confirm = std::move(text)});
  if (!is_over(engine_.status().state))
    return wait(
        seen, {.state = QueueActivity::waits, .reason = "the bench has another run", .item = next->item.item},
        look_again);
  if (next->plan->wait && !wait_for_condition(*next, seen)) return;
  run_item(*next, seen);
}

std::optional<Error> Queue::start_run(RunRequest request, const std::string& path) {
  request.last_word = [this] {
    const std::scoped_lock lock(mutex_);
    if (!started_ || ending_) throw Error(ErrorCode::bad_state, "the queue was stopped");
  };
  try {
    engine_.start(request, path);
  } catch (const Error& refused) {
    return refused;
  } catch (const std::exception& defect) {
    return Error(ErrorCode::internal, defect.what());
  }
  return std::nullopt;
}

// Whether it may be tried again as it is: the queue was stopped, or others have the bench.
bool Queue::passes(const Error& refused, std::int64_t item) {
  const std::scoped_lock lock(mutex_);
  doing_ = {.state = QueueActivity::waits, .item = item};
  return !started_ || ending_ || refused.code() == ErrorCode::busy;
}

Queue::Outcome Queue::outcome_of(const Error& refused) {
  Outcome out{.state = ItemState::failed, .reason = in_one_line(refused.what()), .recorded = false};
  if (refused.code() == ErrorCode::interlock_open) out.alarm = out.reason;
  return out;
}

RunStatus Queue::end_of(const std::string& run) {
  try {
    return engine_.wait(run);
  } catch (const Error&) {  // another run has come after it
    return engine_.status(run);
  }
}

// Whether what the plan waits for has come. If not, the item waits still, or it has failed.
bool Queue::wait_for_condition(const Ledger::Entry& next, std::uint64_t seen) {
  const auto item = next.item.item;
  const auto watch = std::make_shared<Watch>(*next.plan->wait);
  auto request = request_of(*next.plan, next.step);
  request.protocol = hold_of(*next.plan->wait, request.protocol);
  request.set.erase("sample_rate_Hz");
  request.id = to_string(boost::uuids::random_generator()());
  request.watch = [watch](const recordings::Rows& rows) { watch->see(rows); };
  request.stop_wanted = [watch] { return watch->reason(); };
  const auto path = engine_.store().new_recording("wait");
  std::optional<Outcome> outcome;
  if (const auto refused = start_run(request, path.string())) {
    if (passes(*refused, item)) {
      wait(seen, {.state = QueueActivity::waits, .reason = refused->message(), .item = item}, look_again);
      return false;
    }
    outcome = outcome_of(*refused);
  }
  while (!outcome && !is_over(engine_.status(request.id).state)) {
    bool stopped = false;
    {
      Lock lock(mutex_);
      stopped = !started_ || ending_;
      doing_ = {.state = QueueActivity::waits, .reason = "for " + watch->now(), .item = item};
    }
    if (stopped) watch->give_up("the queue was stopped");
    if (const auto first = ledger().next(); !first || first->item.item != item)
      watch->give_up("another item comes first");
    if (!watch->reason().empty()) break;
    show();
    Lock lock(mutex_);
    changed_.wait_for(lock, look_again, [&] { return !started_ || ending_ || version_ != seen; });
    seen = version_;
  }
  if (!outcome) {
    outcome = outcome_of(end_of(request.id));
    const auto verdict = watch->verdict();
    const bool by_bench = !outcome->by_person && outcome->state != ItemState::complete;
    if (outcome->alarm.empty() && !by_bench && verdict != Watch::Verdict::failed) {
      if (verdict == Watch::Verdict::none) {
        come_to_rest("stopped while it waited for " + watch->now() + ": " + outcome->reason);
        return false;
      }
      try {
        recordings::remove_recording(path.string());
      } catch (const Error&) {  // it is worth no trouble
      }
      return verdict == Watch::Verdict::met;
    }
    if (!by_bench && verdict == Watch::Verdict::failed)
      outcome = Outcome{.state = ItemState::failed, .reason = watch->reason(), .alarm = outcome->alarm};
  }
  if (ledger().begin(item, request.id, path.stem())) settle(next, request.id, *outcome);
  return false;
}

void Queue::run_item(const Ledger::Entry& next, std::uint64_t seen) {
  const auto run = to_string(boost::uuids::random_generator()());
  auto request = request_of(*next.plan, next.step);
  request.id = run;
  const auto path = engine_.store().new_recording(protocol_name(*next.plan));
  if (!ledger().begin(next.item.item, run, path.stem())) return;  // it was removed just now
  {
    const std::scoped_lock lock(mutex_);
    doing_ = {.state = QueueActivity::running, .item = next.item.item};
  }
  show();
  const auto refused = start_run(request, path.string());
  if (!refused) return follow(next, run);
  if (passes(*refused, next.item.item)) {
    ledger().put_back(next.item.item, run);
    return wait(seen, {.state = QueueActivity::waits, .reason = refused->message(), .item = next.item.item},
                look_again);
  }
  settle(next, run, outcome_of(*refused));
}

void Queue::follow(const Ledger::Entry& entry, const std::string& run) {
  {
    const std::scoped_lock lock(mutex_);
    doing_ = {.state = QueueActivity::running, .item = entry.item.item};
  }
  settle(entry, run, outcome_of(end_of(run)));
}

Queue::Outcome Queue::outcome_of(const RunStatus& run) {
  Outcome out{.reason = run.reason, .recorded = !run.recording.empty()};
  switch (run.ending) {
    case RunEnding::complete:
      out.state = ItemState::complete;
      break;
    case RunEnding::broken_off:
      out.state = ItemState::broken_off;
      break;
    case RunEnding::stopped:
      out.state = ItemState::aborted;
      out.by_person = true;
      break;
    case RunEnding::none:
    case RunEnding::limit:
    case RunEnding::interlock:
    case RunEnding::fault:
      out.state = ItemState::failed;
      break;
  }
  out.limit = run.ending == RunEnding::limit;
  if (run.ending == RunEnding::interlock) out.alarm = run.reason;
  if (!run.output_at_zero) out.alarm = "the output may not be at zero: " + run.reason;
  if (!run.warning.empty()) out.alarm = run.warning;
  return out;
}

// Of a run whose end no server has seen: what its recording says, which has been recovered by now.
Queue::Outcome Queue::outcome_of_recording(const std::string& run, const std::string& recording) const {
  Outcome out{.state = ItemState::broken_off, .reason = "nothing was recorded", .recorded = false};
  recordings::Summary summary;
  try {
    summary = recordings::read_summary(engine_.store().recording(recording).string());
  } catch (const Error& error) {
    if (error.code() == ErrorCode::not_found) return out;
    out.recorded = true;
    out.reason = in_one_line(error.what());
    return out;
  }
  if (summary.header.entry_identifier != run) return out;  // its name has gone to another one
  out.recorded = true;
  out.reason = summary.reason;
  if (summary.status == "complete") {
    out.state = ItemState::complete;
  } else if (summary.status == "aborted" && !bench::broke_off(summary.reason)) {
    out.state = ItemState::aborted;
    out.by_person = true;  // or by a limit: a person has to look in any case
  } else if (out.reason.empty()) {
    out.reason = "a process or the machine died";
  }
  return out;
}

void Queue::settle(const Ledger::Entry& entry, const std::string& run, const Outcome& outcome) {
  const auto item = entry.item.item;
  const auto& rules = entry.plan->rules;
  auto state = outcome.state;
  if (state == ItemState::broken_off && ledger().entry(item).item.runs <= rules.repeat_broken)
    state = ItemState::waiting;
  ledger().finish(item, run, outcome.state, state, outcome.reason, outcome.recorded);
  if (state == ItemState::complete) try {  // while nothing else is done: a summary need not read them all
      const auto made = engine_.store().recording(ledger().entry(item).item.recording);
      ledger().set_figures(run, figures_of(made.string()));
    } catch (const std::exception&) {  // the summary tries again
    }
  {
    const std::scoped_lock lock(mutex_);
    doing_ = {.state = QueueActivity::waits};
  }
  const auto facts = write_json(ledger().entry(item).item);
  tell(HookEvent::run_ended, facts);
  if (outcome.limit) tell(HookEvent::limit_tripped, facts);
  const auto what = "item " + std::to_string(item) + " of " + in_quotes(entry.item.name);
  if (!outcome.alarm.empty())
    come_to_rest(outcome.alarm);
  else if (outcome.by_person)
    come_to_rest(what + " was stopped: " + outcome.reason);
  else if (outcome.limit && rules.stop_on_limit)
    come_to_rest("a limit tripped in " + what + ": " + outcome.reason);
  else if (outcome.state == ItemState::failed && rules.stop_after_failures > 0 &&
           ledger().failures(entry.item.plan) >= rules.stop_after_failures)
    come_to_rest(what + " failed: " + outcome.reason);
  touch();
  show();
}

}  // namespace ferrobench::server
