// What is dear of Surroundings<DualNumber>, whose numbers carry many tangents, compiled for each instruction
// set. The values that go with the tangents are the same in all of them.
#pragma once

#include "model/surroundings.h"

namespace ferrobench::model::wide {

using Number = DualNumber;

// out = around.sense(trial, since)
void sense(Surroundings<Number>& around, const Trial<Number>& trial, const Number& since,
           Sensed<Number>& out);

}  // namespace ferrobench::model::wide
