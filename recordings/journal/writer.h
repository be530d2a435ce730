// Appends a run to its journal. A record is with the operating system when append() returns, so the death of
// the program costs none; a thread brings it to the disk at once and again every 50 ms at most, so the
// writing thread never waits for a slow disk. What rows_on_disk() counts, a power cut cannot take, as long as
// nobody removes or renames the file.
//
// Thread-safe against its own thread only: one caller. After a failed write the journal ends with its last
// whole record; after a failed fsync nothing more is promised, and append() says so for good.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

#include "recordings/disk/durable_file.h"
#include "recordings/journal/records.h"

namespace ferrobench::recordings {

// NAME.h5 has the journal NAME.h5.journal.
std::string journal_path(const std::string& recording);

class JournalWriter {
 public:
  // Makes a new file, locked for as long as this lives: by the lock others know that the run goes on.
  JournalWriter(const std::string& path, Begin begin);
  // Goes on with one that has its first record and nothing else, which whoever made it has locked. Only the
  // columns of `layout` are looked at.
  JournalWriter(Descriptor begun, const std::string& path, Begin layout);
  ~JournalWriter();
  JournalWriter(const JournalWriter&) = delete;
  JournalWriter& operator=(const JournalWriter&) = delete;

  // Appending rows asks for no memory.
  void append(const Rows& rows);
  void append(const Event& event);
  void append(const Ending& ending);
  void sync();    // returns when all of it is on the disk
  void remove();  // the file, if it still has its name

  const Begin& begin() const { return begin_; }
  std::uint64_t rows() const { return rows_; }
  std::uint64_t rows_on_disk() const;
  // Looked at with each sync. Once it is not, it stays so, and nothing counts as being on the disk.
  bool is_in_place() const;
  Descriptor file() const;  // another one for the same open file, to read it whatever its name
  // How long the oldest byte that is not on the disk has been waiting for it.
  std::chrono::steady_clock::duration waiting() const;

 private:
  void begin_syncing();
  void add(RecordKind kind, std::uint32_t rows, std::string_view payload);
  void keep_synced();
  void throw_if_failed() const;

  std::string path_;
  Begin begin_;
  Descriptor file_;
  std::uint64_t sequence_ = 0, rows_ = 0;
  bool torn_ = false;  // ends with a part of a record that could not be cut off
  std::string payload_, record_;

  mutable std::mutex mutex_;  // over what follows
  std::condition_variable changed_;
  std::uint64_t written_ = 0, synced_ = 0;  // bytes
  std::uint64_t rows_written_ = 0, rows_synced_ = 0;
  std::chrono::steady_clock::time_point oldest_{};  // when the first byte after synced_ came, or earlier
  int failure_ = 0;
  bool in_place_ = true, hurry_ = false, stop_ = false;
  std::thread syncer_;
};

}  // namespace ferrobench::recordings
