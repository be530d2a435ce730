// Writes a recording as an HDF5 file in NeXus layout (version 1).
//
// While a run goes on, its rows are appended to a journal beside (NAME.h5.journal, journal/records.h), which
// survives the death of the program at any byte; finish() makes the HDF5 file of it, puts that in place
// whole, and removes the journal. recover.h makes the file where that did not come to pass.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "recordings/disk/new_file.h"
#include "recordings/format/parts.h"

namespace ferrobench::recordings {

class Writer {
 public:
  // `path` is the file to be. If it or its journal is there: NameTaken, or, if that is to be replaced, the
  // file stays until finish() and the journal goes now, unless somebody writes it: Error(busy). `channels`
  // and `raw` say which columns there will be.
  Writer(const std::string& path, const Header& header, std::span<const Channel> channels,
         std::span<const RawColumn> raw = {}, Existing existing = Existing::keep);
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

  // Does the journal still stand where it was made? If somebody has removed it or given it another name, the
  // file is made nevertheless, but nothing is left of the recording when the program dies: no row counts as
  // being on the disk.
  bool is_in_place() const;

  // Closes the recording with segments, noise, end time (start time plus the last sample's) and status
  // ("complete" | "aborted"), also after an append that failed; `measured` rows there were, if more than were
  // appended. If the file cannot be made the journal stays: Error.
  void finish(const std::string& status, const std::string& reason, std::span<const SegmentRow> segments,
              const std::array<std::optional<double>, 5>& noise, std::uint64_t measured = 0);
  void discard();  // there was nothing to record

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// In one go. A file that was there is replaced once the new one is whole, or NameTaken.
void write_recording(const std::string& path, const Recording& recording,
                     Existing existing = Existing::replace);
// Reads a file, lets `change` change what it says, and writes it anew. One after the other, whichever program
// asks: no change is lost.
void change_recording(const std::string& path, const std::function<void(Recording&)>& change);

}  // namespace ferrobench::recordings
