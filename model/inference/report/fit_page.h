// A fit as one page that needs nothing else: what came out, how sure it is, and pictures of measurement and
// model.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "model/inference/report/fit_verdict.h"
#include "model/inference/study/fit.h"

namespace ferrobench::model {

struct FitPage {
  const FitResult& result;
  const FitOptions& options;
  const ResidualModel& residuals;
  const Model& start;
  std::vector<std::pair<std::string, double>> before, after;  // ResidualModel::summary()
  std::optional<FitVerdict> verdict;                          // none of what was stopped
};

// HTML. Recordings are simulated once more for the pictures.
std::string html_report(const FitPage& page);

}  // namespace ferrobench::model
