#include "server/engine/run.h"

#include <array>
#include <boost/lockfree/spsc_queue.hpp>
#include <boost/uuid/random_generator.hpp>
#include <boost/uuid/uuid_io.hpp>
#include <cmath>
#include <semaphore>

#include "base/visible.h"
#include "daq/guard/check.h"
#include "daq/replay/replay_source.h"
#include "model/model.h"
#include "recordings/disk/new_file.h"
#include "recordings/format/iso_time.h"
#include "server/engine/sink.h"

namespace ferrobench::server {

namespace {

constexpr std::size_t queue_blocks = 256;  // of 0.1 s each in real time
constexpr std::chrono::milliseconds status_interval{200};
constexpr std::chrono::seconds writer_patience{10};  // with a writer that hangs

// The past with the way to the program's first level, which is not recorded. Towards + it does not touch a
// specimen that is poled so.
protocols::Past on_to(protocols::Past past, double from, double level, double slew) {
  using protocols::FirstState;
  using protocols::PastKind;
  if (!past.known() || level == from || (past.kind == PastKind::poled_plus && level >= 0)) return past;
  // What ends a cycle is not known here.
  if (past.kind == PastKind::cycled || !std::isfinite(from) || !(slew > 0)) return {};
  if (past.kind == PastKind::poled_minus) past.from = FirstState::poled_minus;
  if (past.kind == PastKind::unpoled) past.from = FirstState::unpoled;
  past.kind = PastKind::visited;
  past.levels.push_back({level, std::abs(level - from) / slew});
  return past.levels.size() > protocols::most_visited_levels ? protocols::Past{} : past;
}

recordings::Header measured_header(const RunSetup& setup, const daq::Device& device) {
  recordings::Header header;
  header.title = setup.plan.protocol.title();
  header.protocol = setup.plan.protocol.json();
  header.model = device.model();
  // What the device knows of the specimen, else what the program's author says.
  header.past = device.past();
  if (!header.past.known()) header.past = setup.plan.protocol.past().value_or(protocols::Past{});
  if (header.model.is_null()) {
    header.specimen = device.specimen().value_or(recordings::Specimen{});
    header.load = device.load();
    return header;
  }
  const auto model = model::model_from_json(header.model);
  const auto& a = model.actuator;
  header.specimen = {model.name, a.length, a.area, a.layer_thickness, a.layer_count};
  header.load = {model.load.spring_stiffness, model.load.prestress};
  return header;
}

recordings::Header header_of(const RunSetup& setup, const daq::Device& device,
                             const protocols::SampledWaveform& program, double slew) {
  const double rate = program.rate();
  auto header = setup.replay != nullptr ? setup.replay->header() : measured_header(setup, device);
  if (setup.replay == nullptr)
    header.past = on_to(std::move(header.past), device.output(), program.value(0), slew);
  header.start_time = recordings::iso_now();
  header.entry_identifier = to_string(boost::uuids::random_generator()());
  header.device = device.info();
  header.device["sample_rate_asked"] = setup.plan.sample_rate;
  header.device["sample_rate"] = rate;
  if (!setup.rerun_of.empty()) header.device["rerun_of"] = setup.rerun_of;
  if (header.device.contains("seed")) header.run_seed = header.device["seed"].get<std::int64_t>();
  return header;
}

protocols::SampledWaveform program_of(const RunSetup& setup) {
  if (setup.replay != nullptr) return setup.replay->program();
  return {setup.plan.protocol.expand(), setup.device->scan_rate(setup.plan.sample_rate)};
}

daq::Limits limits_of(const RunSetup& setup) {
  return setup.replay != nullptr ? setup.replay->limits(setup.limits) : setup.limits;
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

// Blocks go round: free -> acquisition -> full -> writer -> free. A null block ends the run.
struct Run::Pipe {
  using Queue = boost::lockfree::spsc_queue<daq::SampleBlock*, boost::lockfree::capacity<queue_blocks + 1>>;
  std::vector<daq::SampleBlock> blocks{queue_blocks};
  Queue free, full;
  std::counting_semaphore<> filled{0}, returned{0};
  bool wait_for_writer;
  using Clock = std::chrono::steady_clock;
  std::atomic<std::size_t> waiting = 0, most_waiting = 0;
  std::atomic<Clock::time_point> taken{Clock::time_point::max()};  // when the writer began its block

  explicit Pipe(bool wait) : wait_for_writer(wait) {
    for (auto& block : blocks) free.push(&block);
  }
  // Null if the writer is too far behind.
  daq::SampleBlock* take_free() {
    daq::SampleBlock* block = nullptr;
    while (!free.pop(block)) {
      if (!wait_for_writer) return nullptr;
      returned.acquire();
    }
    return block;
  }
  void put_full(daq::SampleBlock* block) {
    full.push(block);
    most_waiting = std::max(most_waiting.load(), ++waiting);
    filled.release();
  }
  daq::SampleBlock* take_full() {
    filled.acquire();
    daq::SampleBlock* block = nullptr;
    full.pop(block);
    --waiting;
    taken = Clock::now();
    return block;
  }
  void put_free(daq::SampleBlock* block) {
    taken = Clock::time_point::max();
    free.push(block);
    if (wait_for_writer) returned.release();
  }
  bool writer_hangs() const {
    const auto since = taken.load();
    return !wait_for_writer && since != Clock::time_point::max() && Clock::now() - since > writer_patience;
  }
};

Run::Run(RunSetup setup, Hub& hub)
    : setup_(std::move(setup)),
      hub_(hub),
      pipe_(std::make_unique<Pipe>(!setup_.real_time)),
      guard_(std::make_unique<daq::Guard>(*setup_.device, limits_of(setup_), setup_.interlock)),
      program_(program_of(setup_)),
      begin_(std::chrono::steady_clock::now()) {
  if (auto found = daq::check(program_, guard_->limits()); !found.empty())
    throw Error(ErrorCode::limit_exceeded, "the program goes beyond a limit", std::move(found));
  if (auto found = setup_.device->problems(program_); !found.empty())
    throw Error(ErrorCode::limit_exceeded, "the device cannot play the program", std::move(found));
  const auto header = header_of(setup_, *setup_.device, program_, guard_->limits().stop_slew);
  started_ = header.start_time;
  while (!sink_) try {
      sink_ = std::make_unique<Sink>(
          setup_.path, setup_.existing, header,
          daq::Scaling(setup_.device->columns(), setup_.device->signals(), program_.rate()), hub_, setup_.id);
    } catch (const recordings::NameTaken&) {
      if (!setup_.next_path) throw;
      setup_.path = setup_.next_path();
    }
  if (!setup_.notes.empty()) sink_->add_event({0, "note", setup_.notes});
  if (program_.distortion() > 0.5 / program_.rate())
    sink_->add_event({0, "stretched",
                      "the sample rate is too low for the program's corners: one of them is " +
                          std::to_string(program_.distortion()) + " s late"});
  tell();
}

void Run::begin(const std::string& stopped) {
  if (!stopped.empty()) abort(stopped);
  writer_ = std::thread([this] { write(); });
  acquisition_ = std::thread([this] { acquire(); });
}

Run::~Run() {
  guard_->stop("the bench shuts down");
  wait();
}

void Run::wait() {
  const std::scoped_lock lock(joining_);
  if (acquisition_.joinable()) acquisition_.join();
  if (writer_.joinable()) writer_.join();
}

void Run::acquire() {
  std::string failure;
  try {
    guard_->go_to(program_.value(0), guard_->limits().stop_slew);
    guard_->start(program_);
    daq::SampleBlock spare;
    for (;;) {
      auto* block = pipe_->take_free();
      if (block == nullptr || pipe_->writer_hangs()) guard_->stop("the disk does not keep up");
      if (setup_.stop_wanted)
        if (const auto reason = setup_.stop_wanted(); !reason.empty()) guard_->stop(reason);
      const bool more = guard_->read(block == nullptr ? spare : *block);
      // The writer sees the rows that a spare block took away as a gap.
      if (block != nullptr) pipe_->put_full(block);
      if (!more) break;
    }
  } catch (const std::exception& error) {
    failure = in_one_line(error.what());
  }
  guard_->release();
  {
    const std::scoped_lock lock(mutex_);
    reason_ = failure;
  }
  pipe_->put_full(nullptr);
}

void Run::write() {
  auto shown = std::chrono::steady_clock::time_point{};
  auto state = RunState::idle;
  while (auto* block = pipe_->take_full()) {
    sink_->take(*block);
    pipe_->put_free(block);
    if (!sink_->trouble().empty()) guard_->stop(sink_->trouble());
    const auto now = std::chrono::steady_clock::now();
    const auto now_in = status().state;
    if (now_in == state && now - shown < status_interval) continue;
    state = now_in;
    shown = now;
    tell();
  }
  const auto outcome = guard_->outcome();
  std::string reason = reason_.empty() ? outcome.reason : reason_;
  daq::ReplaySource::Closing closing{.status = {}, .reason = reason, .segments = guard_->segments()};
  const bool complete = outcome.end == daq::End::complete && reason.empty();
  closing.status = complete ? "complete" : "aborted";
  // A replay played whole is a complete run, of a recording that may be anything.
  if (setup_.replay != nullptr && reason_.empty()) closing = setup_.replay->closing(*guard_);
  if (!sink_->failure().empty()) {
    reason = closing.reason = sink_->failure();
    closing.status = "aborted";
  }
  // A guard that never had a stream has told nobody.
  if (outcome.end == daq::End::none && !outcome.warning.empty())
    sink_->add_event({0, "fault", outcome.warning});
  const bool recorded =
      sink_->finish(closing.status, closing.reason, closing.segments, setup_.device->noise());
  if (!sink_->failure().empty()) reason = sink_->failure();
  setup_.device.reset();  // who is told of the end may open it
  {
    const std::scoped_lock lock(mutex_);
    state_ = complete && sink_->failure().empty() ? RunState::complete : RunState::aborted;
    reason_ = reason;
    ended_ = recordings::iso_now();
    at_zero_ = outcome.output_at_zero;
    warning_ = outcome.warning;
    recorded_ = recorded;
  }
  tell();
}

void Run::tell() {
  const std::scoped_lock lock(telling_);
  hub_.publish("run", write_json(status()));
}

std::size_t Run::queued_blocks() const {
  return pipe_->waiting;
}

RunStatus Run::status() const {
  using Guarded = daq::Progress::State;
  const std::scoped_lock lock(mutex_);
  const auto guarded = guard_->progress();
  RunStatus out{.run = setup_.id,
                .protocol = setup_.plan.name,
                .title = setup_.plan.title,
                .device = setup_.device_name,
                .recording = std::filesystem::path(setup_.path).stem(),
                .path = setup_.path,
                .rows = static_cast<std::int64_t>(guarded.rows_read),
                .rows_on_disk = static_cast<std::int64_t>(sink_->rows_on_disk()),
                .rows_expected = static_cast<std::int64_t>(guarded.rows_expected),
                .queue_used = std::min(1.0, static_cast<double>(pipe_->most_waiting) / queue_blocks),
                .sample_rate = program_.rate(),
                .started = started_,
                .output_at_zero = false};
  if (guarded.state == Guarded::idle) out.rows_expected = static_cast<std::int64_t>(program_.size());
  out.duration = static_cast<double>(out.rows_expected) / out.sample_rate;
  out.progress = std::min(1.0, static_cast<double>(out.rows) / static_cast<double>(out.rows_expected));
  out.state = state_;
  out.reason = reason_;
  out.ended = ended_;
  if (is_over(state_)) {
    out.output_at_zero = at_zero_;
    out.warning = warning_;
    if (!recorded_) out.recording = out.path = "";
    return out;
  }
  switch (guarded.state) {
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
      out.state = guard_->outcome().end == daq::End::complete ? RunState::running : RunState::stopping;
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
  guard_->pause();
  tell();
}

void Run::resume() {
  guard_->resume();
  tell();
}

void Run::abort(const std::string& reason, bool again) {
  if (!asked_to_stop_.exchange(true)) return stop(reason);
  if (!again) hasten();
}

void Run::stop(const std::string& reason) {
  guard_->stop(reason);
  tell();
}

void Run::hasten() {
  guard_->hasten();
  tell();
}

}  // namespace ferrobench::server
