// Fits and calibrations of a model, as clients ask for them.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "base/fields.h"
#include "model/inference/study/fit.h"

namespace ferrobench::server {

struct FitRequest {
  std::vector<std::string> tables;  // either these or recordings
  std::vector<std::string> free;    // paths of the parameters that move; none: the usual ones
  nlohmann::json set = nlohmann::json::object();
  std::int64_t starts = 6, iterations = 30, seed = 1;
  bool calibrate = false;
  bool report = false;
};
template <class Visitor>
void describe(Visitor& visit, FitRequest& r) {
  visit("tables", r.tables,
        {.doc = "published tables to come near to, fitted together, by the simulation that table.run uses"});
  visit("free", r.free, {.doc = "paths of the parameters that move, for example material.barrier"});
  visit("set", r.set, {.doc = "parameters of the tables' protocols, for example {\"rate\": 10}"});
  visit("starts", r.starts,
        {.min = 1,
         .max = 1000,
         .doc = "starts: the first is the model given, each of the others comes from a global search"});
  visit("iterations", r.iterations,
        {.min = 1, .max = 10000, .doc = "of each least-squares solution, at most"});
  visit("seed", r.seed, {.min = 0, .doc = "of the global searches"});
  visit("calibrate", r.calibrate,
        {.doc = "take the critical force of the parametrized polycrystal from one slow loop, or from two at "
                "different prestress; nothing is fitted"});
  visit("report", r.report, {.doc = "a page with pictures, as \"html\" of the result"});
}

// {model, parameters: [{path, from, to, std, interval, determined, low, high, at_bound}], correlations,
// before, after: {name: rms}, cost_before, cost_after, simulations, stopped, unused: [sentence], pasts:
// [{recording, chosen, kind, from, levels}], verdict: {text, times_noise, where, at_bound, parameters,
// intervals_hold}}: `pasts` are what the specimen had been through before each recording (protocols/past.h),
// `chosen` by the fit or as recorded; `before` is under them as well. `low` and `high` are the range,
// `interval` is that of 95 %, `correlations` a row for each parameter. `verdict` says how far to believe it
// (model/inference/report/fit_verdict.h); its `times_noise` is null where tables were fitted to. What was
// stopped has no uncertainty: `std` is 0; `interval`, `determined`, `correlations` and `verdict` are absent.
// With `report` there is a page too, as `html`. A calibration gives {model} alone. `progress` returns false,
// between simulations, and `stop` true, in their middle, to end with the best so far: then there is no before
// and after. Throws Error(invalid_params) if there is nothing to fit to, or both.
nlohmann::json fit_model(const FitRequest& request, const model::Model& start,
                         std::vector<recordings::Recording> recordings,
                         const std::function<bool(const model::FitProgress&)>& progress,
                         const std::function<bool()>& stop = {});

}  // namespace ferrobench::server
