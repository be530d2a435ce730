#include "server/bench/recorder.h"

#include <chrono>

#include "base/error.h"
#include "base/visible.h"
#include "recordings/format/iso_time.h"

namespace ferrobench::bench {

namespace {

constexpr std::chrono::milliseconds prompt{250};  // a disk that takes longer is noted
constexpr std::chrono::seconds patience{10};      // one that takes longer still ends the run
constexpr std::size_t gap_rows = 8192;            // written at a time

recordings::Begin layout_of(const daq::Scaling& scaling) {
  return {{},
          {scaling.channels().begin(), scaling.channels().end()},
          {scaling.columns().begin(), scaling.columns().end()}};
}

}  // namespace

Recorder::Recorder(recordings::Descriptor journal, const std::string& path, daq::Scaling scaling, Tell tell)
    : scaling_(std::move(scaling)),
      tell_(std::move(tell)),
      journal_(std::make_unique<recordings::JournalWriter>(std::move(journal), path, layout_of(scaling_))) {}

template <class F>
void Recorder::guarded(F&& write) {
  if (!failure_.empty()) return;
  try {
    write();
  } catch (const std::exception& error) {
    failure_ = "the recording cannot be written: " + in_one_line(error.what());
  }
}

void Recorder::store(const recordings::Rows& rows) {
  guarded([&] {
    journal_->append(rows);
    last_time_ = rows.time.back();
  });
  rows_ += rows.time.size();
}

void Recorder::fill_gap(const daq::SampleBlock& before) {
  const auto until = before.first_sample;
  while (rows_ < until && before.time.empty())
    store(scaling_.gap(rows_, std::min<std::uint64_t>(until - rows_, gap_rows)));
  std::vector<double> time;
  while (rows_ < until) {
    const auto left = static_cast<double>(until - rows_ + 1);
    const double from = last_time_, step = (before.time.front() - from) / left;
    time.clear();
    for (std::uint64_t i = 1; i <= std::min<std::uint64_t>(until - rows_, gap_rows); ++i)
      time.push_back(from + step * static_cast<double>(i));
    store(scaling_.gap(time));
  }
}

void Recorder::take(const daq::SampleBlock& block) {
  if (block.rows > 0) {
    fill_gap(block);
    store(scaling_.rows(block));
  }
  for (const auto& event : block.events) add_event(event);
  watch_disk();
}

void Recorder::watch_disk() {
  rows_on_disk_ = journal_->rows_on_disk();
  const auto waiting = journal_->waiting();
  const double time = last_time_;
  if (waiting > patience && failure_.empty()) failure_ = "the disk does not answer";
  if (trouble_.empty() && !journal_->is_in_place()) {
    trouble_ = "the journal of the recording was removed or renamed while the run went on";
    add_event(
        {time, "journal_gone",
         trouble_ + "; the file is made of it at the end, but the end of the program would have cost it"});
  }
  if (waiting <= prompt || slow_) return;
  slow_ = true;
  add_event({time, "slow_disk",
             "the disk takes longer than 0.25 s to confirm what was written; a power cut now could cost more "
             "than that, the end of the program could not"});
}

void Recorder::add_event(const recordings::Event& event) {
  guarded([&] { journal_->append(event); });
  tell_(event);
}

void Recorder::finish(recordings::Ending& ending, const std::string& start_time) {
  ending.end_time = recordings::iso_after(start_time, last_time_).value_or(recordings::iso_now());
  rows_kept_ = journal_->rows();
  ending.rows_lost = rows_ - rows_kept_;
  if (rows_ > 0) try {
      journal_->append(ending);
      journal_->sync();
    } catch (const Error&) {  // the server has the ending, too, and makes the file of what there is
    }
  rows_on_disk_ = journal_->rows_on_disk();
  journal_.reset();
}

}  // namespace ferrobench::bench
