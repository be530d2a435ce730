// The experiment that would tell two explanations apart.
//
// For each protocol of the library: what the one explanation gives is taken as measured, with the bench's
// noise, and the other may adjust its numbers to it as far as the recordings that are there allow:
//
//   T = min over d of |W (y_A - y_B) - J_B d|^2 + d^T N_B d,      odds = exp(T / 2s)
//
// with N_B the information that B's numbers rest on already, and s (`scale`) that on which evidence counts.
#pragma once

#include "model/discrepancy/naming.h"

namespace ferrobench::model::discrepancy {

// The best one; none if no protocol of the library is expected to decide (odds below 3). Fields beyond those
// of the recordings are left out.
std::optional<NextExperiment> choose_experiment(const RecordingMisfit& misfit,
                                                const std::vector<std::vector<NoiseModel>>& noise,
                                                const Fit& a, const Fit& b, double scale);

}  // namespace ferrobench::model::discrepancy
