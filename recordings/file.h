// The recording as an HDF5 file in NeXus layout (version 1).
//
// While a run goes on, its rows are appended to a journal beside (NAME.h5.journal, journal_format.h), which
// survives the death of the program at any byte; finish() makes the HDF5 file of it, puts that in place
// whole, and removes the journal. recover.h makes the file where that did not come to pass. Reading takes the
// journal where the file is not there yet.
#pragma once

#include <chrono>
#include <memory>
#include <span>
#include <string>

#include "recordings/recording.h"

namespace ferrobench::recordings {

// Columns of equal length; an absent channel is empty. counts: rows by raw columns, may be empty.
struct Rows {
  std::span<const double> time;
  std::array<std::span<const double>, 5> channels;
  std::span<const std::int16_t> counts;
};

// Where the file has a channel.
std::string channel_place(Channel channel);

class Writer {
 public:
  // `path` is the file to be; neither it nor its journal may be there: Error(io_error). `channels` and `raw`
  // say which columns there will be.
  Writer(const std::string& path, const Header& header, std::span<const Channel> channels,
         std::span<const RawColumn> raw = {});
  ~Writer();  // leaves the journal to recovery if finish() was not called
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;

  // After these the death of the program costs nothing of it. Error(disk_full | io_error); nothing goes on
  // after one.
  void append(const Rows& rows);
  void add_event(const Event& event);
  void flush();  // what was appended before is on the disk after
  std::uint64_t rows() const;
  std::uint64_t rows_on_disk() const;  // a power cut cannot take these; grows by itself
  std::chrono::steady_clock::duration waiting()
      const;  // since when the disk owes a confirmation; 0: it does not

  // Closes the recording with segments, noise, end time (start time plus the last sample's) and status
  // ("complete" | "aborted"), also after an append that failed. If the file cannot be made the journal stays:
  // Error.
  void finish(const std::string& status, const std::string& reason, std::span<const SegmentRow> segments,
              const std::array<std::optional<double>, 5>& noise);
  void discard();  // there was nothing to record

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// Any file with the parts that the format marks as required is a recording, whoever wrote it.
// Throws Error(not_found) or Error(bad_recording) with the place in the file. Where only the journal of a run
// is there, that is read: status "running", with a reason if the run broke off.
Recording read_recording(const std::string& path);
// Header, sizes, status, but no samples.
struct Summary {
  Header header;
  std::string path, status, reason, end_time;
  std::uint64_t rows = 0;
  double duration = 0;
  std::vector<Channel> channels;
  std::size_t segment_count = 0, event_count = 0;
};
Summary read_summary(const std::string& path);
// In one go. A file that was there is replaced once the new one is whole.
void write_recording(const std::string& path, const Recording& recording);

}  // namespace ferrobench::recordings
