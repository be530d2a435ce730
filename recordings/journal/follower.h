// Reads a journal while somebody else appends to it, from where it was last, without its lock.
#pragma once

#include <functional>

#include "recordings/disk/durable_file.h"
#include "recordings/journal/records.h"

namespace ferrobench::recordings {

class JournalFollower {
 public:
  // Begins at the end of what is there.
  JournalFollower(Descriptor journal, Begin begin);

  // The rows that have come since, a record at a time, at most `most` bytes of them; what is older is passed
  // over. What is not whole yet comes the next time. A journal that cannot be read gives no rows.
  void next(std::uint64_t most, const std::function<void(const Columns&)>& take);
  void pass_over() { next(0, nullptr); }

 private:
  Descriptor journal_;
  Begin begin_;
  std::uint64_t place_ = 0;
  std::string payload_;
  Columns columns_;
};

}  // namespace ferrobench::recordings
