#include "daq/guard/guard.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "daq/guard/check.h"
#include "daq/not_at_zero.h"

namespace ferrobench::daq {

namespace {

constexpr double go_to_step =
    0.1;  // s; how long a stop or the interlock may wait on the way to the first level

Limits within(Limits limits, const OutputRange& range) {
  if (auto found = problems(limits); !found.empty())
    throw Error(ErrorCode::invalid_params, "the limits are not valid", std::move(found));
  limits.field_min = std::max(limits.field_min, range.min);
  limits.field_max = std::min(limits.field_max, range.max);
  return limits;
}

// What the exception being handled says.
std::string current_failure() {
  try {
    throw;
  } catch (const std::exception& failure) {
    return failure.what();
  } catch (...) {
    return "the driver failed without saying why";
  }
}

double time_of(std::uint64_t row, double rate) {
  return static_cast<double>(row) / rate;
}

}  // namespace

Guard::Guard(Device& device, const Limits& limits, Interlock interlock)
    : device_(device),
      limits_(within(limits, device.output_range())),
      fastest_stop_(std::max(limits_.stop_slew, std::min(limits_.slew, device.fastest_slew()))),
      interlock_(std::move(interlock)),
      columns_(device.columns().size()),
      trips_(limits_, device.columns(), device.measures()) {}

Guard::~Guard() {
  release();
}

void Guard::release() noexcept {
  if (std::exchange(released_, true) || outcome_.output_at_zero) return;
  make_safe();
}

bool Guard::interlock_closed() const {
  return (!interlock_ || interlock_()) && device_.interlock_closed();
}

void Guard::demand_interlock() const {
  if (!interlock_closed())
    throw Error(ErrorCode::interlock_open, "the interlock is open",
                Problem{.message = "no field while it is open", .hint = "close it and start again"});
}

void Guard::demand_fresh() {
  const std::scoped_lock lock(mutex_);
  if (feed_) throw Error(ErrorCode::bad_state, "a guard serves one run");
  if (stop_wanted_) throw Error(ErrorCode::cancelled, "stopped before the start: " + *stop_wanted_);
}

void Guard::go_to(double level, double slew) {
  if (!(level >= limits_.field_min && level <= limits_.field_max))
    throw Error(ErrorCode::limit_exceeded, "the level is beyond a limit",
                Problem{.path = "/level",
                        .message = "is outside the field limits",
                        .given = level,
                        .allowed = {{"from", limits_.field_min}, {"to", limits_.field_max}},
                        .unit = "V/m"});
  if (!(slew > 0))
    throw Error(ErrorCode::invalid_params, "the slew must be positive",
                Problem{.path = "/slew", .given = slew, .unit = "V/m/s"});
  slew = std::min(slew, limits_.slew);
  const double step = slew * go_to_step;
  try {
    for (double here = device_.output(); here != level;) {
      demand_fresh();
      demand_interlock();
      here = std::clamp(level, here - step, here + step);
      device_.go_to(here, slew);
    }
  } catch (...) {
    make_safe();
    throw;
  }
}

void Guard::start(protocols::SampledWaveform program) {
  demand_fresh();
  demand_interlock();
  if (program.size() == 0) throw Error(ErrorCode::bad_protocol, "the program has no samples");
  if (auto found = check(program, limits_); !found.empty())
    throw Error(ErrorCode::limit_exceeded, "the program goes beyond a limit", std::move(found));
  if (auto found = device_.problems(program); !found.empty())
    throw Error(ErrorCode::limit_exceeded, "the device cannot play the program", std::move(found));
  const double first = program.value(0);
  if (!(std::abs(device_.output() - first) <= 1e-6 * (limits_.field_max - limits_.field_min)))
    throw Error(
        ErrorCode::bad_state, "the output is not at the program's first level",
        Problem{.given = device_.output(), .allowed = first, .unit = "V/m", .hint = "go_to() it first"});
  const double rate = program.rate();
  if (const double real = device_.scan_rate(rate); std::abs(real - rate) > 1e-9 * rate)
    throw Error(ErrorCode::invalid_params, "the device does not run at this rate",
                Problem{.path = "/sample_rate",
                        .given = rate,
                        .allowed = real,
                        .unit = "Hz",
                        .hint = "sample the program at Device::scan_rate()"});
  {
    const std::scoped_lock lock(mutex_);
    feed_.emplace(std::move(program), limits_);
    if (stop_wanted_) feed_->stop(End::stopped, *stop_wanted_);
    if (hastened_) feed_->hasten(fastest_stop_);
  }
  try {
    device_.start(rate, *this);
  } catch (...) {
    SampleBlock none;
    finish(End::fault, current_failure(), none);
    throw;
  }
}

LinearPiece Guard::next(std::uint64_t max_samples) {
  const std::scoped_lock lock(mutex_);
  if (!feed_ || outcome_.end != End::none) return {};
  return feed_->next(max_samples);
}

std::size_t Guard::next_levels(std::span<double> levels) {
  const std::scoped_lock lock(mutex_);
  if (!feed_ || outcome_.end != End::none) return 0;
  return feed_->next_levels(levels);
}

bool Guard::read(SampleBlock& block) {
  block.clear();
  {
    const std::scoped_lock lock(mutex_);
    if (!feed_ || outcome_.end != End::none) return false;
    if (interlock_ && !interlock_()) feed_->stop(End::interlock, "the interlock opened");
  }
  try {
    if (!device_.interlock_closed()) {
      const std::scoped_lock lock(mutex_);
      feed_->stop(End::interlock, "the device's interlock line opened");
    }
    if (!device_.read(block)) {
      block.drop_rows();
      std::unique_lock lock(mutex_);
      const bool whole = feed_->over() && rows_read_ == feed_->issued();
      const End end = !whole ? End::fault : feed_->stopping() ? feed_->end() : End::complete;
      const std::string reason = whole                   ? feed_->reason()
                                 : last_trouble_.empty() ? "the device ended before the program"
                                                         : "the device ended: " + last_trouble_;
      lock.unlock();
      return finish(end, reason, block);
    }
    const auto fault = fault_in(block);
    account(block);
    if (!fault.empty()) return finish(End::fault, fault, block);
  } catch (...) {
    block.drop_rows();
    return finish(End::fault, current_failure(), block);
  }
  return true;
}

// What makes it impossible to go on, or nothing. Rows that have no place in the recording are dropped.
std::string Guard::fault_in(SampleBlock& block) {
  const std::scoped_lock lock(mutex_);
  const auto fits = [&block](const std::vector<double>& v) { return v.empty() || v.size() == block.rows; };
  const bool torn = block.counts.size() != block.rows * columns_ || !fits(block.time) ||
                    !std::ranges::all_of(block.signals, fits);
  const bool stray = block.rows > 0 &&
                     (block.first_sample < rows_read_ || block.first_sample + block.rows > feed_->issued());
  if (torn || stray) {
    block.drop_rows();
    return torn ? "the device returned a torn block"
                : "the device returned samples that were never asked for";
  }
  if (block.status == BlockStatus::underrun || block.status == BlockStatus::stall ||
      block.status == BlockStatus::device_lost || block.status == BlockStatus::misaligned)
    return std::string(block_status_name(block.status)) + ": " + block.message;
  // A silent read lasts about a second, and a slow scan has every right to that.
  silent_reads_ = block.rows > 0 ? 0 : silent_reads_ + 1;
  if (silent_reads_ > 3 + 3 / feed_->rate()) return "the device stopped sending samples";
  return {};
}

void Guard::account(SampleBlock& block) {
  const auto trip = trips_.violation(block);
  const std::scoped_lock lock(mutex_);
  const double rate = feed_->rate();
  const double time = time_of(block.first_sample, rate);
  if (block.rows > 0) {
    if (block.first_sample > rows_read_)
      block.events.push_back({time_of(rows_read_, rate), "gap",
                              std::to_string(block.first_sample - rows_read_) + " rows were lost"});
    rows_read_ = block.first_sample + block.rows;
    feed_->take_rows(block);
  }
  if (block.status != last_status_ && block.status != BlockStatus::ok)
    block.events.push_back({time, std::string(block_status_name(block.status)), block.message});
  last_status_ = block.status;
  last_trouble_ = block.status == BlockStatus::ok || block.status == BlockStatus::clipped
                      ? ""
                      : std::string(block_status_name(block.status)) + ": " + block.message;
  if (trip) feed_->stop(End::limit, *trip);
  feed_->take_events(block.events);
}

// Ends the run. True if `block` still has something for the recording.
bool Guard::finish(End end, std::string reason, SampleBlock& block) {
  {
    const std::scoped_lock lock(mutex_);
    outcome_.end = end;  // the source is dry from here on
    feed_->take_events(block.events);
    if (end == End::fault) block.events.push_back({time_of(rows_read_, feed_->rate()), "fault", reason});
  }
  make_safe();
  const std::scoped_lock lock(mutex_);
  outcome_.reason = std::move(reason);
  if (!outcome_.warning.empty())
    block.events.push_back({time_of(rows_read_, feed_->rate()), "fault", outcome_.warning});
  return block.rows > 0 || !block.events.empty();
}

// A driver that fails once may still obey the next time; one that never obeys is reported by the outcome.
void Guard::make_safe() noexcept {
  constexpr int attempts = 3;
  std::string why = "the device does not say that it is";
  bool safe = false;
  for (int attempt = 0; attempt <= attempts && !safe; ++attempt) {
    try {
      double here = device_.output();
      safe = here == 0;
      // In steps, so that it can be hastened. An output that is nowhere goes straight to zero.
      while (here != 0 && attempt < attempts) {
        const double slew = stop_slew(), step = slew * go_to_step;
        here = std::abs(here) > step ? here - std::copysign(step, here) : 0;
        device_.go_to(here, slew);
      }
    } catch (...) {
      why = current_failure();
    }
  }
  const std::scoped_lock lock(mutex_);
  outcome_.output_at_zero = safe;
  outcome_.warning = safe ? "" : not_at_zero(why);
}

void Guard::pause() {
  const std::scoped_lock lock(mutex_);
  if (!feed_ || outcome_.end != End::none) throw Error(ErrorCode::bad_state, "no run to pause");
  feed_->pause();
}

void Guard::resume() {
  const std::scoped_lock lock(mutex_);
  if (!feed_ || outcome_.end != End::none || !(feed_->paused() || feed_->pausing()))
    throw Error(ErrorCode::bad_state, "the run is not paused");
  feed_->resume();
}

void Guard::stop(const std::string& reason) {
  const std::scoped_lock lock(mutex_);
  if (!feed_) {
    stop_wanted_ = reason;
  } else if (outcome_.end == End::none) {
    feed_->stop(End::stopped, reason);
  }
}

void Guard::hasten() {
  const std::scoped_lock lock(mutex_);
  hastened_ = true;
  if (feed_) feed_->hasten(fastest_stop_);
}

double Guard::stop_slew() const {
  const std::scoped_lock lock(mutex_);
  return hastened_ ? fastest_stop_ : limits_.stop_slew;
}

Progress Guard::progress() const {
  using State = Progress::State;
  const std::scoped_lock lock(mutex_);
  if (!feed_) return {};
  Progress out{.rows_read = rows_read_, .rows_expected = feed_->expected(), .rate = feed_->rate()};
  if (outcome_.end != End::none) {
    out.state = State::ended;
  } else if (feed_->stopping()) {
    out.state = State::stopping;
  } else if (feed_->paused()) {
    out.state = State::paused;
  } else {
    out.state = feed_->pausing() ? State::pausing : State::running;
  }
  return out;
}

Outcome Guard::outcome() const {
  const std::scoped_lock lock(mutex_);
  return outcome_;
}

std::vector<recordings::SegmentRow> Guard::segments() const {
  const std::scoped_lock lock(mutex_);
  return feed_ ? feed_->segments(feed_->recorded()) : std::vector<recordings::SegmentRow>{};
}

}  // namespace ferrobench::daq
