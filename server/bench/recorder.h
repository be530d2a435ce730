// Where the blocks of a run end: scaled to SI, and into the journal.
//
// Rows that were lost on the way are written as NaN (raw counts as the lowest one), so that every row has its
// number. Where not every row of the device is recorded their times are evenly spread over the gap. After a
// failure to write the run goes to its end by a safe stop, and the failure is kept; so it is when the disk
// has owed the confirmation of a write for 10 s. Somebody who takes the journal away ends the run, too; the
// server makes the file of the open journal all the same.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>

#include "daq/scaling.h"
#include "recordings/journal/writer.h"

namespace ferrobench::bench {

class Recorder {
 public:
  using Tell = std::function<void(const recordings::Event&)>;
  // `tell` hears of each event. Throws what JournalWriter throws.
  Recorder(recordings::Descriptor journal, const std::string& path, daq::Scaling scaling, Tell tell);

  void take(const daq::SampleBlock& block);
  void add_event(const recordings::Event& event);
  // Closes the journal. `ending`: end time and lost rows are filled in; start_time is ISO 8601.
  void finish(recordings::Ending& ending, const std::string& start_time);

  std::uint64_t rows_kept() const { return rows_kept_; }        // in the journal, once it is closed
  std::uint64_t rows_on_disk() const { return rows_on_disk_; }  // for any thread
  const std::string& failure() const { return failure_; }       // to write; "" if all went well
  // Why the run is to end; what it measures until then is still recorded if it can be. "" if all goes well.
  const std::string& trouble() const { return failure_.empty() ? trouble_ : failure_; }

 private:
  template <class F>
  void guarded(F&& write);
  void fill_gap(const daq::SampleBlock& before);
  void store(const recordings::Rows& rows);
  void watch_disk();

  daq::Scaling scaling_;
  Tell tell_;
  std::unique_ptr<recordings::JournalWriter> journal_;
  std::string failure_, trouble_;
  std::uint64_t rows_ = 0;
  std::uint64_t rows_kept_ = 0;
  double last_time_ = 0;
  std::atomic<std::uint64_t> rows_on_disk_ = 0;
  bool slow_ = false;
};

}  // namespace ferrobench::bench
