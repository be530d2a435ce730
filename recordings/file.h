// The recording as an HDF5 file in NeXus layout (version 1).
//
// While a run goes on, rows are appended uncompressed and flushed; finish() rewrites the file shuffled and
// compressed beside the original and renames it over, so compression costs the acquisition nothing and a
// crash loses at most what was not flushed.
#pragma once

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
  // Creates `path` (never overwrites: Error(io_error)); `channels` and `raw` say which columns there will be.
  Writer(const std::string& path, const Header& header, std::span<const Channel> channels,
         std::span<const RawColumn> raw = {});
  ~Writer();  // leaves status "running" if finish() was not called
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;

  void append(const Rows& rows);  // Error(disk_full | io_error)
  void add_event(const Event& event);
  void flush();  // what was appended before is on disk after
  std::uint64_t rows() const;

  // Writes segments, noise, end time (start time plus the last sample's) and status ("complete" | "aborted"),
  // and closes the file. Where the disk has no room for the compressed copy, the file stays as it was
  // written.
  void finish(const std::string& status, const std::string& reason, std::span<const SegmentRow> segments,
              const std::array<std::optional<double>, 5>& noise);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// Any file with the parts that the format marks as required is a recording, whoever wrote it.
// Throws Error(not_found) or Error(bad_recording) with the place in the file.
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
