// Which samples of a piece of a program are recorded: evenly, or in a hold ever more rarely, since creep goes
// with the logarithm of time.
#pragma once

#include <cstdint>

namespace ferrobench::protocols {

// What a piece asks for.
struct Recorded {
  double rate = 0;  // rows/s; 0: as the program
  double per_decade =
      0;  // rows in each decade of the time since the piece began, where that is fewer; 0: any
};

// One sample after the other, the first after the piece's beginning being number 1. Of n samples the n-th is
// a corner, which is recorded whatever next() says.
class RecordedRows {
 public:
  RecordedRows() = default;  // every sample
  // `rate` in S/s. At least as many rows a second as are asked for: every k-th sample with k a whole number.
  RecordedRows(Recorded asked, double rate);

  bool all() const { return stride_ == 1 && growth_ == 0; }
  std::uint64_t stride() const { return stride_; }  // samples from row to row, at first
  // Whether the next sample is recorded.
  bool next() {
    if (++sample_ < due_) return false;
    due_ = sample_ + step(sample_);
    return true;
  }
  std::uint64_t count(std::uint64_t samples) const;  // that are recorded, of a piece of so many

 private:
  std::uint64_t step(std::uint64_t from) const;

  std::uint64_t stride_ = 1;
  double growth_ = 0;          // of the time from row to row, as a share of the time so far; 0: none
  std::uint64_t longest_ = 1;  // samples from row to row at the most
  std::uint64_t sample_ = 0, due_ = 1;
};

}  // namespace ferrobench::protocols
