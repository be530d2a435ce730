// Reads a journal that somebody else may be writing, may have left at any byte, or may have damaged. All that
// lies before the first record that is not whole counts; nothing after it does.
#pragma once

#include <functional>

#include "recordings/disk/durable_file.h"
#include "recordings/journal/records.h"

namespace ferrobench::recordings {

class JournalReader {
 public:
  // How the file ends. torn: within a record, as a write that was cut short leaves it. damaged: something
  // else than a record follows.
  enum class Tail { whole, torn, damaged };

  // Looks through all of it, as far as it goes now. Error(not_found), Error(bad_recording) if it does not
  // begin as a journal; `begun` is false, and nothing else known, if it was left before its first record was
  // whole.
  explicit JournalReader(const std::string& path);
  // A journal that the caller has opened; `path` is for messages.
  JournalReader(Descriptor file, std::string path);

  bool begun() const { return begun_; }
  const Begin& begin() const { return begin_; }
  std::uint64_t rows() const { return rows_; }
  double first_time() const { return first_time_; }  // s; 0 without rows
  double last_time() const { return last_time_; }
  const std::vector<Event>& events() const { return events_; }
  const std::optional<Ending>& ending() const { return ending_; }
  Tail tail() const { return tail_; }
  std::uint64_t bytes() const { return good_; }
  std::uint64_t bytes_lost() const { return size_ - good_; }
  bool is_being_written() const { return is_locked(file_); }

  // All rows in order, at least `portion` of them at a time but for the last. Error(bad_recording) if the
  // file has changed.
  void read(std::size_t portion, const std::function<void(const Columns&)>& take) const;

 private:
  void scan();
  bool take(const RecordHead& head, std::uint64_t place, std::string_view payload);
  std::string bytes_at(std::uint64_t place, std::uint64_t count) const;

  struct Place {
    std::uint64_t offset;  // of the payload
    RecordHead head;
  };

  std::string path_;
  Descriptor file_;
  bool begun_ = false;
  Begin begin_;
  std::vector<Place> places_;  // of the rows
  std::vector<Event> events_;
  std::optional<Ending> ending_;
  std::uint64_t rows_ = 0, good_ = 0, size_ = 0;
  double first_time_ = 0, last_time_ = 0;
  Tail tail_ = Tail::whole;
};

// Does the file begin as a journal does?
bool is_journal(const std::string& path);
// A journal as a recording: status "running" or "broken_off", or what its end says.
Recording read_journal(const std::string& path);
Summary summarize_journal(const std::string& path);

}  // namespace ferrobench::recordings
