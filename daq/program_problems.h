// Collects what is wrong with a program before it is played. A segment of a protocol can be thousands of
// pieces (cycles, points, repeats): each kind of problem is told once for it, by its worst piece.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "protocols/waveform.h"

namespace ferrobench::daq {

class ProgramProblems {
 public:
  explicit ProgramProblems(const protocols::Waveform& waveform) : waveform_(waveform) {}

  // `problem.path` is what of the segment is wrong ("rate") and becomes a whole pointer; `excess` says which
  // of two is worse.
  void add(std::size_t piece, double excess, Problem problem);
  std::vector<Problem> take() { return std::move(problems_); }

 private:
  struct Told {
    std::size_t index;
    double excess;
  };
  const protocols::Waveform& waveform_;
  std::map<std::pair<std::string, std::string>, Told> told_;  // by path and message
  std::vector<Problem> problems_;
};

}  // namespace ferrobench::daq
