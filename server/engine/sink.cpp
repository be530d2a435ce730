#include "server/engine/sink.h"

#include <chrono>

#include "base/visible.h"
#include "recordings/format/iso_time.h"

namespace ferrobench::server {

namespace {

constexpr std::chrono::milliseconds prompt{250};  // a disk that takes longer is noted
constexpr std::chrono::seconds patience{10};      // one that takes longer still ends the run
constexpr std::size_t gap_rows = 8192;            // written at a time

}  // namespace

Sink::Sink(const std::string& path, recordings::Existing existing, const recordings::Header& header,
           daq::Scaling scaling, Hub& hub, std::string run)
    : scaling_(std::move(scaling)), hub_(hub), run_(run), live_(hub, std::move(run)) {
  writer_.emplace(path, header, scaling_.channels(), scaling_.columns(), existing);
}

template <class F>
void Sink::guarded(F&& write) {
  if (!failure_.empty()) return;
  try {
    write();
  } catch (const std::exception& error) {
    failure_ = "the recording cannot be written: " + in_one_line(error.what());
  }
}

void Sink::store(const recordings::Rows& rows) {
  guarded([&] { writer_->append(rows); });
  live_.add(rows);
  rows_ += rows.time.size();
}

void Sink::fill_gap(std::uint64_t until) {
  while (rows_ < until) store(scaling_.gap(rows_, std::min<std::uint64_t>(until - rows_, gap_rows)));
}

void Sink::take(const daq::SampleBlock& block) {
  if (block.rows > 0) {
    fill_gap(block.first_sample);
    store(scaling_.rows(block));
  }
  for (const auto& event : block.events) add_event(event);
  watch_disk();
}

void Sink::watch_disk() {
  rows_on_disk_ = writer_->rows_on_disk();
  const auto waiting = writer_->waiting();
  if (waiting > patience && failure_.empty()) failure_ = "the disk does not answer";
  if (trouble_.empty() && !writer_->is_in_place()) {
    trouble_ = "the journal of the recording was removed or renamed while the run went on";
    add_event(
        {static_cast<double>(rows_) / scaling_.rate(), "journal_gone",
         trouble_ + "; the file is made of it at the end, but the end of the program would have cost it"});
  }
  if (waiting <= prompt || slow_) return;
  slow_ = true;
  add_event({static_cast<double>(rows_) / scaling_.rate(), "slow_disk",
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
    writer_->finish(status, reason, segments, noise, rows_);
    rows_on_disk_ = written;
  } catch (const std::exception& error) {
    if (failure_.empty()) failure_ = "the recording's file cannot be made: " + in_one_line(error.what());
  }
  return rows_ > 0;
}

}  // namespace ferrobench::server
