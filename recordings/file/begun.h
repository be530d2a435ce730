// The recording of a run that another process measures: begun here, its rows appended to the open journal
// there, made into a file here.
#pragma once

#include <memory>
#include <string>

#include "recordings/disk/new_file.h"
#include "recordings/journal/reader.h"
#include "recordings/journal/writer.h"

namespace ferrobench::recordings {

class BegunRecording {
 public:
  // Makes the journal, with its first record, and sees to it that the file can be made; errors as Writer's.
  BegunRecording(const std::string& path, const Begin& begin, Existing existing);
  // One that has been begun, with its open journal. Error(bad_recording).
  BegunRecording(const std::string& path, Descriptor journal, Existing existing);

  const Begin& begin() const { return begin_; }
  // Another descriptor for the same open journal, and the same lock.
  Descriptor journal() const;

  // Once nobody writes the journal any more, which has `rows`: makes the file of it, with this ending, and
  // removes it. If the file cannot be made the journal stays: Error.
  void finish(const Ending& ending, std::uint64_t rows);
  void discard();  // there was nothing to record

 private:
  std::string path_;
  Existing existing_;
  Begin begin_;
  Descriptor journal_;
};

}  // namespace ferrobench::recordings
