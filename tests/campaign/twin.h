// A bench in software, written apart from the model it is to test: same equations, but its own stepping, its
// own nodes, its own solution of the mechanics. Slow and plain.
//
// Within a step the field goes linearly between its ends, the stress too; both ends are found together with
// the fractions (coupled loads are iterated, and the step is halved where that fails). Steps are as long as
// the samples, shorter where the field changes ln(rate) by more than `path` or where a corner was just
// passed.
#pragma once

#include <vector>

#include "model/model.h"
#include "protocols/past.h"

namespace ferrobench::campaign {

struct TwinOptions {
  int domains = 16384;
  double path = 1;          // largest change of ln(rate) in a step
  double session_time = 0;  // s, of the first sample since the session began
  protocols::Past past{};   // before the first sample; unknown: poled towards +
};

struct Response {
  std::vector<double> field, charge, displacement, force;  // at the monitor, and as sensed; SI
};

// `effects`: ids of the catalogue and outsiders, besides the base model's own. The command is linear between
// samples. Error(invalid_params) for a past of cycles, Error(bad_model) for what the twin does not have: the
// unequal barrier, the parametrized polycrystal.
Response play(const model::Model& model, const std::vector<model::EffectSetting>& effects,
              const std::vector<double>& time, const std::vector<double>& command,
              const TwinOptions& options = {});

}  // namespace ferrobench::campaign
