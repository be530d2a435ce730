#include "server/bench/run.h"

#include <boost/lockfree/spsc_queue.hpp>
#include <semaphore>

#include "base/visible.h"
#include "daq/guard/check.h"
#include "recordings/format/texts.h"
#include "server/bench/priority.h"

namespace ferrobench::bench {

namespace {

constexpr std::size_t most_events = 1000;            // that wait for the server; the journal has all
constexpr std::chrono::seconds writer_patience{10};  // with a writer that hangs

// Drivers give blocks of up to 0.1 s; twice that is for one that was held up. What is longer asks for memory.
std::size_t rows_of_block(double rate) {
  constexpr double longest = 0.2;       // s
  constexpr double most_rows = 25'000;  // so long at the highest output rate of all devices
  return static_cast<std::size_t>(std::clamp(longest * rate, 64.0, most_rows));
}

protocols::SampledWaveform program_of(const Prepare& asked, const daq::Device& device) {
  const auto waveform = asked.program.waveform();
  // The device scans as fast as any segment is recorded.
  const double rate = std::max(asked.rate, waveform.fastest_recorded());
  return {waveform, asked.exact_rate ? asked.rate : device.scan_rate(rate), asked.rate};
}

}  // namespace

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

  Pipe(bool wait, std::size_t rows, std::size_t columns) : wait_for_writer(wait) {
    for (auto& block : blocks) {
      block.counts.reserve(rows * columns);
      block.command.reserve(rows);
      block.time.reserve(rows);
      free.push(&block);
    }
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

Run::Run(std::shared_ptr<daq::Device> device, const Prepare& asked, std::function<void()> changed)
    : device_(std::move(device)),
      changed_(std::move(changed)),
      guard_(*device_, asked.limits),
      program_(program_of(asked, *device_)),
      pipe_(std::make_unique<Pipe>(!asked.real_time, rows_of_block(program_.rate()),
                                   device_->columns().size())) {
  if (auto found = daq::check(program_, guard_.limits()); !found.empty())
    throw Error(ErrorCode::limit_exceeded, "the program goes beyond a limit", std::move(found));
  if (auto found = device_->problems(program_); !found.empty())
    throw Error(ErrorCode::limit_exceeded, "the device cannot play the program", std::move(found));
}

Run::~Run() {
  guard_.stop(shuts_down);
  if (acquisition_.joinable()) acquisition_.join();
  if (writer_.joinable()) writer_.join();
}

Prepared Run::prepared() const {
  return {program_.rate(),   program_.distortion(),     program_.size(),
          program_.value(0), guard_.limits().stop_slew, daq::facts_of(*device_)};
}

void Run::begin(const Begin& asked, recordings::Descriptor journal, bool urgent) {
  if (begun()) throw Error(ErrorCode::bad_state, "this run has begun already");
  start_time_ = asked.start_time;
  urgent_ = urgent && device_->model().is_null();  // a model computes as much as it may
  daq::Scaling scaling(device_->columns(), device_->signals(), program_.rate());
  scaling.reserve(rows_of_block(program_.rate()));
  recorder_ = std::make_unique<Recorder>(std::move(journal), asked.path, std::move(scaling),
                                         [this](const recordings::Event& event) { note(event); });
  for (const auto& event : asked.events) recorder_->add_event(event);
  writer_ = std::thread([this] { write(); });
  acquisition_ = std::thread([this] { acquire(); });
}

void Run::acquire() {
  if (urgent_) go_first();
  std::string failure;
  try {
    guard_.go_to(program_.value(0), guard_.limits().stop_slew);
    guard_.start(program_);
    changed_();
    daq::SampleBlock spare;
    for (;;) {
      auto* block = pipe_->take_free();
      if (block == nullptr || pipe_->writer_hangs()) guard_.stop("the disk does not keep up");
      const bool more = guard_.read(block == nullptr ? spare : *block);
      // The writer sees the rows that a spare block took away as a gap.
      if (block != nullptr) pipe_->put_full(block);
      if (!more) break;
    }
  } catch (const std::exception& error) {
    failure = in_one_line(error.what());
  }
  guard_.release();
  {
    const std::scoped_lock lock(mutex_);
    failure_ = failure;
  }
  pipe_->put_full(nullptr);
}

void Run::write() {
  while (auto* block = pipe_->take_full()) {
    recorder_->take(*block);
    pipe_->put_free(block);
    if (!recorder_->trouble().empty()) guard_.stop(recorder_->trouble());
    changed_();
  }
  const auto outcome = guard_.outcome();
  recordings::Ending ending{.end_time = {},
                            .status = {},
                            .reason = failure_.empty() ? outcome.reason : failure_,
                            .segments = guard_.segments(),
                            .noise = device_->noise()};
  const auto played = ending.segments;
  ending.status = outcome.end == daq::End::complete && ending.reason.empty() ? "complete" : "aborted";
  if (!recorder_->failure().empty()) {
    ending.reason = recorder_->failure();
    ending.status = "aborted";
  }
  // A guard that never had a stream has told nobody.
  if (outcome.end == daq::End::none && !outcome.warning.empty())
    recorder_->add_event({0, "fault", outcome.warning});
  recorder_->finish(ending, start_time_);
  auto last = state();
  device_.reset();  // who is told of the end may open it
  {
    const std::scoped_lock lock(mutex_);
    last.reason = ending.reason;
    closed_ = Closed{.state = std::move(last),
                     .ending = recordings::ending_text(ending),
                     .failure = recorder_->failure(),
                     .rows = recorder_->rows_kept(),
                     .played = played};
  }
  over_ = true;
  changed_();
}

void Run::note(const recordings::Event& event) {
  const std::scoped_lock lock(mutex_);
  events_.push_back(event);
  if (events_.size() <= most_events) return;
  events_.pop_front();
  ++missed_;
}

std::deque<recordings::Event> Run::take_events(std::uint64_t& missed) {
  const std::scoped_lock lock(mutex_);
  missed = std::exchange(missed_, 0);
  return std::exchange(events_, {});
}

RunState Run::state() const {
  const auto progress = guard_.progress();
  const auto outcome = guard_.outcome();
  RunState out{.guard = progress.state,
               .end = outcome.end,
               .output_at_zero = outcome.output_at_zero,
               .rows = progress.rows_read,
               .rows_expected = progress.rows_expected,
               .rows_on_disk = recorder_ ? recorder_->rows_on_disk() : 0,
               .blocks_waiting = static_cast<std::uint32_t>(pipe_->waiting),
               .most_waiting = static_cast<std::uint32_t>(pipe_->most_waiting),
               .reason = outcome.reason,
               .warning = outcome.warning};
  if (out.guard == daq::Progress::State::idle) out.rows_expected = program_.size();
  return out;
}

std::optional<Closed> Run::closed() const {
  const std::scoped_lock lock(mutex_);
  return closed_;
}

}  // namespace ferrobench::bench
