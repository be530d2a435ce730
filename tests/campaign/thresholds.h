// What halving and doubling each threshold of `discover` does to its answers.
#pragma once

#include <string>
#include <vector>

#include "tests/campaign/score.h"

namespace ferrobench::campaign {

struct ThresholdStudy {
  std::string benches;  // folder of benches, as write_bench() made them
  std::string log;      // a line of JSON for each answer; what it holds is not asked again
  int first = 0, count = 25, jobs = 1;
  std::vector<std::string> only{};  // names of thresholds; empty: all
};

// Asks every bench with the thresholds as they are, and with each halved and doubled in turn. Each answer is
// told and written down as it comes. Error(invalid_params) for a threshold that there is not.
void ask_with_other_thresholds(const ThresholdStudy& study);
// A row for each threshold in the log: answers that changed, that became wrong, that became right, and the
// processor time against that of the thresholds as they are.
std::string table_of_thresholds(const std::string& log);

}  // namespace ferrobench::campaign
