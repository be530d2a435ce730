#include "server/engine/sink.h"

#include <chrono>
#include <limits>

#include "recordings/iso_time.h"

namespace ferrobench::server {

using recordings::Channel;

namespace {

constexpr std::chrono::milliseconds prompt{250};  // a disk that takes longer is noted
constexpr std::chrono::seconds patience{10};      // one that takes longer still ends the run
constexpr std::size_t gap_rows = 8192;            // written at a time

std::vector<Channel> channels_of(const std::vector<recordings::RawColumn>& columns) {
  std::vector<Channel> out;
  for (const auto channel : recordings::all_channels)
    if (channel == Channel::command ||
        std::ranges::any_of(columns, [&](const auto& c) { return c.channel == channel; }))
      out.push_back(channel);
  return out;
}

}  // namespace

Sink::Sink(const std::string& path, const recordings::Header& header,
           std::vector<recordings::RawColumn> columns, double rate, Hub& hub, std::string run)
    : columns_(std::move(columns)), rate_(rate), hub_(hub), run_(run), live_(hub, std::move(run)) {
  writer_.emplace(path, header, channels_of(columns_), columns_);
}

template <class F>
void Sink::guarded(F&& write) {
  if (!failure_.empty()) return;
  try {
    write();
  } catch (const std::exception& error) {
    failure_ = std::string("the recording cannot be written: ") + error.what();
  }
}

void Sink::resize(std::size_t rows) {
  time_.resize(rows);
  for (const auto channel : channels_of(columns_)) values_.at(static_cast<std::size_t>(channel)).resize(rows);
  counts_.resize(rows * columns_.size());
  for (std::size_t i = 0; i < rows; ++i) time_[i] = static_cast<double>(rows_ + i) / rate_;
}

void Sink::store() {
  recordings::Rows rows{.time = time_, .channels = {}, .counts = counts_};
  for (std::size_t c = 0; c < values_.size(); ++c) rows.channels.at(c) = values_.at(c);
  guarded([&] { writer_->append(rows); });
  live_.add(rows);
  rows_ += time_.size();
}

void Sink::fill_gap(std::uint64_t until) {
  while (rows_ < until) {
    resize(std::min<std::uint64_t>(until - rows_, gap_rows));
    for (auto& column : values_) std::ranges::fill(column, std::numeric_limits<double>::quiet_NaN());
    std::ranges::fill(counts_, std::numeric_limits<std::int16_t>::min());
    store();
  }
}

void Sink::take(const daq::SampleBlock& block) {
  if (block.rows > 0) {
    fill_gap(block.first_sample);
    resize(block.rows);
    values_[static_cast<std::size_t>(Channel::command)] = block.command;
    counts_ = block.counts;
    const std::size_t width = columns_.size();
    for (std::size_t c = 0; c < width; ++c) {
      auto& to = values_.at(static_cast<std::size_t>(columns_[c].channel));
      for (std::size_t i = 0; i < block.rows; ++i)
        to[i] = columns_[c].offset + columns_[c].gain * counts_[i * width + c];
    }
    store();
  }
  for (const auto& event : block.events) add_event(event);
  watch_disk();
}

void Sink::watch_disk() {
  rows_on_disk_ = writer_->rows_on_disk();
  const auto waiting = writer_->waiting();
  if (waiting > patience && failure_.empty()) failure_ = "the disk does not answer";
  if (waiting <= prompt || slow_) return;
  slow_ = true;
  add_event({static_cast<double>(rows_) / rate_, "slow_disk",
             "the disk takes longer than 0.25 s to confirm what was written; a power cut now could cost more "
             "than that, the end of the program could not"});
}

void Sink::add_event(const recordings::Event& event) {
  guarded([&] { writer_->add_event(event); });
  hub_.publish("events", {{"run", run_},
                          {"time", recordings::iso_now()},
                          {"time_s", event.time},
                          {"kind", event.kind},
                          {"message", event.message}});
}

bool Sink::finish(const std::string& status, const std::string& reason,
                  std::span<const recordings::SegmentRow> segments,
                  const std::array<std::optional<double>, 5>& noise) {
  live_.finish();
  try {  // also after a failure: what was written before it is a recording
    const auto written = writer_->rows();
    if (rows_ == 0) {
      writer_->discard();
      return false;
    }
    writer_->finish(status, reason, segments, noise);
    rows_on_disk_ = written;
  } catch (const std::exception& error) {
    if (failure_.empty()) failure_ = std::string("the recording's file cannot be made: ") + error.what();
  }
  return rows_ > 0;
}

}  // namespace ferrobench::server
