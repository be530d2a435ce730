// Where the blocks of a run end: scaled to SI, into the recording and to whoever watches.
//
// Rows that were lost on the way are written as NaN (raw counts as the lowest one), so that a row's number is
// its time. After a failure to write, blocks are still shown and the failure is kept; so it is when the disk
// has owed the confirmation of a write for 10 s. Somebody who takes the journal away ends the run, too, and
// its file is made all the same.
#pragma once

#include <atomic>
#include <optional>
#include <string>

#include "daq/scaling.h"
#include "recordings/file/writer.h"
#include "server/engine/live.h"

namespace ferrobench::server {

class Sink {
 public:
  // Throws what recordings::Writer throws.
  Sink(const std::string& path, recordings::Existing existing, const recordings::Header& header,
       daq::Scaling scaling, Hub& hub, std::string run);

  void take(const daq::SampleBlock& block);
  void add_event(const recordings::Event& event);
  // The recording is whole after this. Without a single row there is no recording: false.
  bool finish(const std::string& status, const std::string& reason,
              std::span<const recordings::SegmentRow> segments,
              const std::array<std::optional<double>, 5>& noise);

  std::uint64_t rows() const { return rows_; }
  std::uint64_t rows_on_disk() const { return rows_on_disk_; }  // for any thread
  const std::string& failure() const { return failure_; }       // to write; "" if all went well
  // Why the run is to end; what it measures until then is still recorded if it can be. "" if all goes well.
  const std::string& trouble() const { return failure_.empty() ? trouble_ : failure_; }

 private:
  template <class F>
  void guarded(F&& write);
  void fill_gap(std::uint64_t until);
  void store(const recordings::Rows& rows);
  void watch_disk();

  daq::Scaling scaling_;
  Hub& hub_;
  std::string run_;
  LiveStream live_;
  std::optional<recordings::Writer> writer_;
  std::string failure_, trouble_;
  std::uint64_t rows_ = 0;
  std::atomic<std::uint64_t> rows_on_disk_ = 0;
  bool slow_ = false;
};

}  // namespace ferrobench::server
