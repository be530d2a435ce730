#include "daq/replay/replay_device.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <thread>

#include "recordings/file/reader.h"

namespace ferrobench::daq {

using recordings::Channel;

namespace {

constexpr double chunk_time = 0.1;   // s; how long a stop may wait
constexpr double chunk_rows = 2048;  // 20 ms at 100 kHz: 30 pictures a second are drawn of them
constexpr std::chrono::seconds patience{1};
constexpr auto never = std::numeric_limits<std::uint64_t>::max();

std::chrono::nanoseconds nanoseconds(double seconds) {
  // Far enough for any replay, and within what the clock can count.
  return std::chrono::nanoseconds(static_cast<std::int64_t>(std::min(seconds, 1e9) * 1e9));
}

// A status after which a run goes on, and that the guard turns into the event of its name.
std::optional<BlockStatus> status_of(const recordings::Event& event) {
  for (const auto status : {BlockStatus::overrun, BlockStatus::short_data, BlockStatus::clipped})
    if (event.kind == block_status_name(status)) return status;
  return std::nullopt;
}

}  // namespace

ReplayDevice::ReplayDevice(recordings::Recording recording, const ReplayConfig& config)
    : config_(config), source_(std::move(recording), config) {
  const auto& time = source_.recording().time;
  std::uint64_t row = 0;
  for (const auto& event : source_.recording().events) {
    const auto after = std::upper_bound(time.begin(), time.end(), event.time);
    const auto own = after == time.begin() ? 0 : static_cast<std::uint64_t>(after - time.begin()) - 1;
    event_rows_.push_back(row = std::max(row, own));
  }
}

std::unique_ptr<Device> ReplayDevice::open(const nlohmann::json& json) {
  const auto config = replay_config_from_json(json);
  return std::make_unique<ReplayDevice>(recordings::read_recording(config.file), config);
}

nlohmann::json ReplayDevice::info() const {
  const auto& header = source_.recording().header;
  nlohmann::json out{{"driver", "replay"},
                     {"serial_number", header.entry_identifier},
                     {"source", std::filesystem::path(config_.file).stem().string()},
                     {"source_identifier", header.entry_identifier},
                     {"recorded_with", header.device},
                     {"played", write_json(columns().empty() ? Played::signals : Played::counts)},
                     {"clock", write_json(config_.clock)},
                     {"speed", config_.speed},
                     {"scan_rate", source_.rate()},
                     {"equally_spaced", source_.on_grid()}};
  if (config_.from) out["from"] = *config_.from;
  if (config_.to) out["to"] = *config_.to;
  const auto changes = recalibrations(config_);
  for (const auto channel : recordings::all_channels)
    if (const auto& change = changes[static_cast<std::size_t>(channel)]; change.changes())
      out["recalibrated"][std::string(recordings::channel_name(channel))] = write_json(change);
  return out;
}

std::vector<recordings::RawColumn> ReplayDevice::columns() const {
  return {source_.columns().begin(), source_.columns().end()};
}

std::vector<Channel> ReplayDevice::signals() const {
  return {source_.signals().begin(), source_.signals().end()};
}

double ReplayDevice::scan_rate(double asked) const {
  if (std::abs(asked - source_.rate()) <= 1e-9 * source_.rate()) return source_.rate();
  throw Error(ErrorCode::invalid_params, "a replay has the rows that were recorded",
              Problem{.path = "/sample_rate",
                      .message = "is not the recorded one",
                      .given = asked,
                      .allowed = source_.rate(),
                      .unit = "Hz",
                      .hint = "leave it out; `speed` says how fast it is played"});
}

// Nothing moves: the output is one of long ago.
void ReplayDevice::go_to(double level, double) {
  levels_ = nullptr;
  level_ = level;
}

void ReplayDevice::start(double rate, LevelSource& levels) {
  scan_rate(rate);
  levels_ = &levels;
  row_ = event_ = stretch_ = 0;
  dry_ = false;
  last_status_ = BlockStatus::ok;
  start_ = std::chrono::steady_clock::now();
  pulled_ = 1;
  left_ = std::abs(level_ - source_.command().front()) <= 1e-9 * std::abs(level_) ? never : 0;
}

void ReplayDevice::pull() {
  const bool fast = config_.clock == Clock::fast;
  const double rows = fast ? chunk_rows : std::floor(source_.rate() * config_.speed * chunk_time);
  const auto& command = source_.command();
  const auto until = row_ + static_cast<std::uint64_t>(std::clamp(rows, 1.0, chunk_rows));
  if (!dry_ && pulled_ < until) {
    std::vector<double> levels(until - pulled_);
    levels.resize(levels_->next_levels(levels));
    dry_ = pulled_ + levels.size() < until;
    for (const double level : levels) {
      if (left_ == never && (pulled_ >= command.size() || level != command[pulled_])) left_ = pulled_;
      ++pulled_;
    }
    if (!levels.empty()) level_ = levels.back();
  }
  due_ = start_;
  if (!fast && pulled_ > row_)
    due_ += nanoseconds(static_cast<double>(pulled_ - 1) / source_.rate() / config_.speed);
}

bool ReplayDevice::read(SampleBlock& block) {
  block.clear();
  if (levels_ == nullptr) return false;
  if (row_ == 0 || row_ == pulled_) pull();
  if (row_ == pulled_) {
    levels_ = nullptr;
    return false;
  }
  const auto now = std::chrono::steady_clock::now();
  if (due_ > now) std::this_thread::sleep_until(std::min(due_, now + patience));
  if (due_ > now + patience) {
    block.status = BlockStatus::timeout;
    block.message = "the next row is not due yet";
    return true;
  }
  answer(block);
  return true;
}

void ReplayDevice::answer(SampleBlock& block) {
  const auto stretches = source_.stretches();
  while (stretch_ + 1 < stretches.size() && stretches[stretch_ + 1].first <= row_) ++stretch_;
  auto known = stretches[stretch_].known;
  auto end = pulled_;
  if (row_ >= left_) {
    known = ReplaySource::Known::only_the_command;
    block.status = BlockStatus::short_data;
    block.message = "the recording has no answer to a level that it does not hold";
  } else {
    end = std::min(end, left_);
    if (stretch_ + 1 < stretches.size()) end = std::min(end, stretches[stretch_ + 1].first);
    end = add_events(block, end);
  }
  block.first_sample = row_;
  block.rows = end - row_;
  copy(block);
  if (known != ReplaySource::Known::all) forget(block, known);
  row_ = end;
  last_status_ = block.status;
}

// The events of the block's first row, in their order; the block ends before the next one's. A status has a
// block of one row to itself, and its event comes from the guard.
std::uint64_t ReplayDevice::add_events(SampleBlock& block, std::uint64_t end) {
  const auto& events = source_.recording().events;
  for (; event_ < events.size(); ++event_) {
    const auto at = event_rows_[event_];
    if (at > row_) return std::min(end, at);
    const auto& event = events[event_];
    const auto status = status_of(event);
    const bool told_later = event_ + 1 == events.size() || row_ + 1 < source_.size();
    if (status && told_later && *status != last_status_ && source_.on_grid() &&
        event.time == source_.time(row_)) {
      block.status = *status;
      block.message = event.message;
      ++event_;
      return row_ + 1;
    }
    block.events.push_back(event);
  }
  return end;
}

void ReplayDevice::copy(SampleBlock& block) const {
  const auto& recording = source_.recording();
  const auto known_rows =
      row_ < source_.size() ? std::min<std::uint64_t>(block.rows, source_.size() - row_) : 0;
  const auto first = static_cast<std::ptrdiff_t>(row_);
  const auto rows = static_cast<std::ptrdiff_t>(known_rows);
  if (const auto width = source_.columns().size(); width > 0) {
    const auto from = recording.raw->counts.begin() + first * static_cast<std::ptrdiff_t>(width) * (rows > 0);
    block.counts.assign(from, from + rows * static_cast<std::ptrdiff_t>(width));
    block.counts.resize(block.rows * width, std::numeric_limits<std::int16_t>::min());
  }
  if (!source_.on_grid())
    for (std::uint64_t row = row_; row < row_ + block.rows; ++row) block.time.push_back(source_.time(row));
  for (const auto channel : source_.signals()) {
    auto& to = block.signals[static_cast<std::size_t>(channel)];
    const auto& from = recording.at(channel);
    if (rows > 0) to.assign(from.begin() + first, from.begin() + first + rows);
    to.resize(block.rows, std::numeric_limits<double>::quiet_NaN());
  }
}

// Whatever is not known is NaN, whichever way it would have come.
void ReplayDevice::forget(SampleBlock& block, ReplaySource::Known known) const {
  const auto drop = [&block](Channel channel) {
    block.signals[static_cast<std::size_t>(channel)].assign(block.rows,
                                                            std::numeric_limits<double>::quiet_NaN());
  };
  if (known != ReplaySource::Known::only_the_command) drop(Channel::command);
  if (known == ReplaySource::Known::not_the_command) return;
  for (const auto channel : source_.signals()) drop(channel);
  for (const auto& column : source_.columns()) drop(column.channel);
}

const ReplaySource* replay_source(const Device& device) {
  const auto* replay = dynamic_cast<const ReplayDevice*>(&device);
  return replay != nullptr ? &replay->source() : nullptr;
}

}  // namespace ferrobench::daq
