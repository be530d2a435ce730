#include "daq/usb/stream.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace ferrobench::daq::usb {

namespace {

constexpr double packet_interval = 0.02;         // s, how old a sample may get on its way
constexpr std::size_t shortest_transfer = 8;     // packets, where the rate fills it in time
constexpr std::size_t longest_transfer = 16384;  // bytes
constexpr std::size_t input_transfers = 16;
// Behind every tick that is handed on lie so many more that the watch has seen: where a sample got lost, the
// marker's place may for a moment show another signal that happens to be at its level.
constexpr std::size_t proof_ticks = 8;
constexpr std::chrono::milliseconds wait_step{5};
constexpr std::chrono::milliseconds look_interval{25};
constexpr double late_looks = 4;    // what a block has room for: a look that comes 0.1 s after the one before
constexpr std::size_t blocks = 32;  // 0.8 s of them for a reader that is held up
constexpr std::chrono::milliseconds silence{1000};

std::chrono::nanoseconds seconds(double s) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(s));
}

constexpr const char* bus_hint =
    "check the cable, connect the unit without a hub, and see that its power holds";

std::string milliseconds(std::chrono::nanoseconds time) {
  return std::to_string(std::chrono::duration_cast<std::chrono::milliseconds>(time).count()) + " ms";
}

std::string wire_hint(StartMode mode) {
  return mode == StartMode::trigger ? "check the wire from DIO0 to TRIG"
                                    : "check the wire from the output's clock pin to the input's";
}

}  // namespace

Stream::Trouble Stream::trouble_of(LinkStatus status, const std::string& what) {
  const auto message = what + ": " + std::string(link_status_name(status));
  switch (status) {
    case LinkStatus::stall:
      return {BlockStatus::stall, message};
    case LinkStatus::timeout:
      return {BlockStatus::timeout, message};
    case LinkStatus::overflow:
      return {BlockStatus::short_data, message + ", more came than was asked for"};
    default:
      return {BlockStatus::device_lost, message};
  }
}

Stream::Stream(Unit& unit, Transfers& transfers, const Inputs& inputs, const StreamPlan& plan,
               LevelSource& source, OutputFeed::ToCode to_code, HostClock& clock, Rest& rest)
    : unit_(unit),
      transfers_(transfers),
      inputs_(inputs),
      plan_(plan),
      to_code_(std::move(to_code)),
      clock_(clock),
      feed_(source, plan.level, plan.pace.oversampling, plan.start.tick_order, to_code_),
      cutter_(inputs.width()),
      watch_(inputs, plan.monitor_check, plan.pace.tick_rate()),
      pace_watch_(plan.pace.tick_rate()) {
  try {
    prepare();
    arm();
    if (trouble_)
      throw Error(
          trouble_->status == BlockStatus::device_lost ? ErrorCode::device_lost : ErrorCode::bad_state,
          trouble_->message, Problem{.path = "/start", .hint = wire_hint(plan_.start.mode)});
    thread_ = std::thread([this] { run(); });  // from here on all but the queue is the thread's
  } catch (...) {
    halt();
    rest = rest_;
    throw;
  }
}

// Full packets where they fill transfers soon enough; else packets of whole ticks that end their transfer
// early.
void Stream::prepare() {
  const double rate = plan_.pace.tick_rate();
  const auto width = inputs_.width();
  const auto packet = unit_.packet_bytes();
  const auto in_time =
      static_cast<std::size_t>(2 * rate * static_cast<double>(width) * packet_interval);  // bytes
  const bool full_packets = in_time >= shortest_transfer * packet;
  auto bytes = shortest_transfer * packet;
  packet_samples_ = packet / 2;
  if (full_packets) {
    bytes = std::min(longest_transfer, in_time / packet * packet);
  } else {
    const auto most = (packet_samples_ - 1) / width;
    const auto wanted = static_cast<std::size_t>(rate * packet_interval);
    packet_samples_ = std::clamp<std::size_t>(wanted, 1, most) * width;
  }
  const auto packet_ticks = std::max<double>(
      1, static_cast<double>(full_packets ? bytes / 2 : packet_samples_) / static_cast<double>(width));
  packet_time_ = seconds(packet_ticks / rate);
  // The unit must never run dry between two packets of news.
  lead_ = std::max(static_cast<std::uint64_t>(plan_.queue_ahead * rate),
                   static_cast<std::uint64_t>(std::ceil(packet_ticks)) + 2);
  chunk_ = std::clamp<std::uint64_t>(lead_ / 5, 1, longest_transfer / 4);
  const auto outputs = lead_ / chunk_ + 2;
  transfers_.prepare(input_transfers, bytes, outputs, 2 * chunk_);
  // Nothing of what follows asks for memory while the thread keeps up.
  const auto ticks = lead_ + chunk_ + input_transfers * bytes / 2 / width;
  cutter_.reserve(ticks);
  feed_.reserve(ticks);
  done_.reserve(input_transfers + outputs);
  const auto rows = static_cast<std::size_t>(
      late_looks * std::chrono::duration<double>(look_interval).count() * plan_.pace.row_rate());
  queue_.prepare(blocks, (rows + proof_ticks) * inputs_.columns().size());
}

void Stream::arm() {
  const bool triggered = plan_.start.mode == StartMode::trigger;
  unit_.stop_output();
  unit_.stop_input();
  if (triggered) {
    unit_.set_latch(plan_.latch);
    unit_.trigger_on_rising_edge();
  }
  unit_.load_queue(inputs_.queue());
  unit_.clear_halts();
  unit_.clear_input();
  unit_.clear_output();
  for (auto& transfer : transfers_.all())
    if (transfer.input)
      if (const auto status = transfers_.submit(unit_.link(), transfer, transfer.buffer.size());
          status != LinkStatus::ok)
        throw LinkFailure(status, "no input transfer can be queued");
  feed();
  if (trouble_) return;
  unit_.start_input({.period = triggered ? plan_.pace.period : 0,
                     .packet_samples = packet_samples_,
                     .triggered = triggered});
  const OutputScan output{
      .period = plan_.pace.period, .channel = plan_.output_channel, .triggered = triggered};
  if (triggered) unit_.start_output(output);
  expect_silence();
  if (trouble_) return;
  pace_watch_.begin(clock_.now());
  if (triggered) {
    unit_.set_latch(static_cast<std::uint8_t>(plan_.latch | 1));
  } else {
    unit_.start_output(output);
  }
  heard_ = looked_ = clock_.now();
}

// Both scans wait; a sample now means that they do not wait for the same thing.
void Stream::expect_silence() {
  for (const auto begin = clock_.now(); clock_.now() - begin < packet_time_ + wait_step && !trouble_;) {
    collect(wait_step);
    if (cutter_.received() > 0) fail({BlockStatus::misaligned, "the input scan did not wait for the start"});
  }
}

void Stream::run() {
  try {
    loop();
  } catch (const LinkFailure& failure) {
    fail(trouble_of(failure.status(), failure.message()));
  } catch (const std::exception& failure) {
    fail({BlockStatus::stall, failure.what()});
  } catch (...) {
    fail({BlockStatus::stall, "the source of levels failed"});
  }
  finish();
}

void Stream::loop() {
  while (!trouble_ && !stop_ && !complete()) turn();
}

void Stream::turn() {
  const auto before = cutter_.received();
  collect(wait_step);
  const auto now = clock_.now();
  if (!trouble_ && cutter_.received() > before)
    if (auto wrong = pace_watch_.check(cutter_.received(), now); !wrong.empty()) {
      judge(unit_.status());  // after an overrun samples are missing, whatever the pacer does
      fail({BlockStatus::misaligned, std::move(wrong)});
    }
  if (!trouble_) feed();
  if (!trouble_ && now - looked_ >= look_interval) {
    looked_ = now;
    look();
  }
  if (!trouble_ && now - heard_ > silence + 3 * packet_time_) fail(silent());
}

void Stream::collect(std::chrono::milliseconds timeout) {
  done_.clear();
  transfers_.wait(unit_.link(), timeout, done_);
  input_late_ |= transfers_.in_flight(true) == 0;
  output_late_ |= transfers_.in_flight(false) == 0;
  for (const auto& done : done_) take(done);
}

Stream::Trouble Stream::silent() const {
  if (cutter_.received() == 0)
    return {BlockStatus::stall, "no sample came after the start: " + wire_hint(plan_.start.mode)};
  return {BlockStatus::timeout, "the unit stopped sending after tick " + std::to_string(cutter_.received()) +
                                    ": no sample came for " + milliseconds(clock_.now() - heard_) +
                                    ", though it says that it is running; " + bus_hint};
}

Stream::Trouble Stream::blocked() const {
  return {BlockStatus::timeout,
          "the unit's input FIFO overran, though the computer waited for its samples: no "
          "sample came for " +
              milliseconds(clock_.now() - heard_) + "; " + bus_hint};
}

void Stream::take(const Transfers::Done& done) {
  if (done.transfer == nullptr)
    return fail(trouble_of(done.status, "a transfer came back that was never sent"));
  if (trouble_) return;
  if (!done.transfer->input) {
    if (done.status != LinkStatus::ok)
      return fail(trouble_of(done.status, "the unit did not take output samples"));
    if (done.actual != done.transfer->size)
      return fail({BlockStatus::short_data, "the unit took " + std::to_string(done.actual) + " of " +
                                                std::to_string(done.transfer->size) + " bytes of output"});
    delivered_ += done.actual / 2;
    return;
  }
  if (done.status != LinkStatus::ok) return fail(trouble_of(done.status, "input samples did not come"));
  if (done.actual > 0) heard_ = clock_.now();
  cutter_.add(std::span(done.transfer->buffer).first(done.actual));
  if (const auto status = transfers_.submit(unit_.link(), *done.transfer, done.transfer->buffer.size());
      status != LinkStatus::ok)
    fail(trouble_of(status, "no input transfer can be queued"));
}

void Stream::feed() {
  while (feed_.filled() + chunk_ <= cutter_.received() + lead_) {
    auto* transfer = transfers_.idle_output();
    if (transfer == nullptr) return;
    feed_.fill(transfer->buffer);
    if (const auto status = transfers_.submit(unit_.link(), *transfer, transfer->buffer.size());
        status != LinkStatus::ok)
      return fail(trouble_of(status, "no output transfer can be queued"));
  }
}

// What has come before this look is whole if the flags say so now: they stay up once they are.
void Stream::look() {
  const auto status = unit_.status();
  if (plan_.interlock_bit) interlock_closed_ = (unit_.pins() >> *plan_.interlock_bit & 1) != 0;
  judge(status);
  if (trouble_) return;
  if (!status.fpga_configured()) return fail({BlockStatus::device_lost, "the unit was reset"});
  if (!status.output_running()) return fail({BlockStatus::underrun, "the output scan ended by itself"});
  if (!status.input_running()) return fail({BlockStatus::short_data, "the input scan ended by itself"});
  // Output that the unit never took cannot have been played.
  if (cutter_.received() > delivered_ + 2 * chunk_)
    return fail({BlockStatus::underrun, "the output does not run: " + std::to_string(cutter_.received()) +
                                            " ticks of input came, the unit took " +
                                            std::to_string(delivered_) + " of output"});
  input_late_ = output_late_ = false;
  vouch(false);
}

// Whose doing it is that a FIFO failed. While a transfer waits for it, it is not the computer's.
void Stream::judge(const UnitStatus& status) {
  if (!status.input_overrun() && !status.output_underrun()) return;
  collect(std::chrono::milliseconds(0));  // what came while the computer was away
  if (trouble_) return;
  if (status.input_overrun())
    return fail(input_late_
                    ? Trouble{BlockStatus::overrun,
                              "the unit's input FIFO overran, as the computer did not take the samples in "
                              "time; choose a lower rate or free the computer"}
                    : blocked());
  // Output follows input: where no input comes, the output runs dry as a consequence.
  if (!input_late_ && clock_.now() - heard_ > packet_time_ + look_interval) return fail(silent());
  fail(output_late_ ? Trouble{BlockStatus::underrun,
                              "the unit's output FIFO ran dry, as the computer did not send in time; raise "
                              "queue_ahead or free the computer"}
                    : Trouble{BlockStatus::underrun,
                              "the unit's output FIFO ran dry, though the computer had samples for it: " +
                                  std::string(bus_hint)});
}

// Hands on what has come, after the watch has seen it.
void Stream::vouch(bool final) {
  const auto codes = cutter_.ticks();
  const auto width = inputs_.width();
  auto here = codes.size() / width;
  if (here > feed_.levels().size()) {
    if (!final) return fail({BlockStatus::underrun, "more input came than there was output for"});
    here = feed_.levels().size();
  }
  const auto seen = static_cast<std::size_t>(watched_ - vouched_);
  if (auto wrong = watch_.check(watched_, codes.subspan(seen * width, (here - seen) * width),
                                feed_.levels().subspan(seen, here - seen));
      !wrong.empty())
    return fail({BlockStatus::misaligned, std::move(wrong)});
  watched_ += here - seen;
  if (here <= proof_ticks) return;
  const auto count = here - proof_ticks;

  const auto columns = inputs_.columns();
  const auto n = plan_.pace.oversampling;
  // Rows are every n-th tick, and no more of them than were asked for.
  const auto rows_until = [&](std::uint64_t tick) { return std::min((tick + n - 1) / n, feed_.rows()); };
  const auto first = rows_until(vouched_);
  const auto rows = rows_until(vouched_ + count) - first;
  if (rows > 0) {
    auto block = queue_.take_empty();
    block.first_sample = first;
    block.rows = rows;
    block.counts.reserve(rows * columns.size());
    std::array<bool, longest_queue> clipped{};
    for (auto row = first; row < first + rows; ++row) {
      const auto* tick = codes.data() + (row * n - vouched_) * width;
      for (std::size_t c = 0; c < columns.size(); ++c) {
        block.counts.push_back(columns[c].count(tick[c]));
        if (tick[c] < columns[c].lowest_code || tick[c] > columns[c].highest_code) clipped.at(c) = true;
      }
    }
    for (std::size_t c = 0; c < columns.size(); ++c) {
      if (!clipped.at(c)) continue;
      block.status = BlockStatus::clipped;
      block.message += (block.message.empty() ? "" : ", ") +
                       std::string(recordings::channel_name(columns[c].column.channel)) +
                       " is past its range";
    }
    if (!queue_.put(std::move(block)))
      return fail({BlockStatus::overrun, "nobody took the samples away for a long time"});
  }
  cutter_.drop(count);
  feed_.drop(count);
  vouched_ += count;
}

bool Stream::complete() const {
  return feed_.over() && vouched_ > (feed_.rows() - 1) * plan_.pace.oversampling;
}

// The first trouble is the one that is told.
void Stream::fail(Trouble trouble) {
  if (!trouble_) trouble_ = std::move(trouble);
}

void Stream::finish() {
  const bool whole = !trouble_ && !stop_;
  // What came before a broken transfer is as good as the unit's flags say.
  if (trouble_ && trouble_->status != BlockStatus::misaligned && trouble_->status != BlockStatus::overrun &&
      trouble_->status != BlockStatus::underrun) {
    try {
      const auto status = unit_.status();
      if (!status.input_overrun() && !status.output_underrun() && status.fpga_configured()) vouch(true);
    } catch (const LinkFailure&) {  // nothing vouches for it
    }
  }
  halt();
  if (whole) {
    try {
      unit_.write_output(plan_.output_channel, to_code_(feed_.last_dropped()));
      rest_.known = true;
    } catch (const LinkFailure& failure) {
      fail(trouble_of(failure.status(), "the last level could not be written"));
      rest_.lost = failure.status() == LinkStatus::no_device;
    }
  }
  if (!trouble_) return queue_.end();
  SampleBlock last;
  last.first_sample = (vouched_ + plan_.pace.oversampling - 1) / plan_.pace.oversampling;
  last.status = trouble_->status;
  last.message = trouble_->message;
  if (const auto lost = cutter_.ticks().size() / inputs_.width(); lost > 0)
    last.message += " (" + std::to_string(lost) + " ticks that nothing vouches for were dropped)";
  queue_.put_last(std::move(last));
}

// Stops both scans and takes the transfers back. The output keeps some level between the last one that input
// came for and the last one sent.
void Stream::halt() {
  const auto try_stop = [&](void (Unit::*stop)()) {
    try {
      (unit_.*stop)();
    } catch (const LinkFailure& failure) {
      if (failure.status() == LinkStatus::no_device) rest_.lost = true;
    }
  };
  try_stop(&Unit::stop_output);
  try_stop(&Unit::stop_input);
  rest_.transfers_back = transfers_.cancel(unit_.link(), clock_);
  rest_.level = rest_.lowest = rest_.highest = feed_.last_dropped();
  for (const double level : feed_.levels()) {
    rest_.lowest = std::min(rest_.lowest, level);
    rest_.highest = std::max(rest_.highest, level);
  }
  const auto unseen = std::min(cutter_.ticks().size() / inputs_.width(), feed_.levels().size());
  if (unseen > 0) rest_.level = feed_.levels()[unseen - 1];
}

Rest Stream::end() {
  stop_ = true;
  if (thread_.joinable()) thread_.join();
  return rest_;
}

}  // namespace ferrobench::daq::usb
