// What an import finds in a file beside its samples, for the user and for the recording: flags of the tester,
// columns that agree or do not, what was taken for what.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace ferrobench::recordings {

struct Finding {
  // note: what was taken for what; check: two sources of one fact, and they agree; warning: what whoever uses
  // the recording should know; flag: of the tester; pulse: where one begins; gap: values that are not there
  std::string kind;
  std::string message;
  double time = 0;  // s, where it belongs to a moment
};
using Findings = std::vector<Finding>;

}  // namespace ferrobench::recordings
