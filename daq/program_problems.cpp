#include "daq/program_problems.h"

#include "base/fields.h"

namespace ferrobench::daq {

void ProgramProblems::add(std::size_t piece, double excess, Problem problem) {
  problem.path = waveform_.place(piece) + "/" + problem.path;
  const auto [at, fresh] =
      told_.try_emplace({problem.path, problem.message}, Told{.index = problems_.size(), .excess = excess});
  if (fresh && problems_.size() >= max_problems) {
    told_.erase(at);
    return;
  }
  if (!fresh && !(excess > at->second.excess)) return;
  problem.message += " in \"" + waveform_.segments()[piece].label + "\"";
  at->second.excess = excess;
  if (fresh)
    problems_.push_back(std::move(problem));
  else
    problems_[at->second.index] = std::move(problem);
}

}  // namespace ferrobench::daq
