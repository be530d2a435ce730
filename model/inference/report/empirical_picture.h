// An empirical term as a picture: what its table adds along a slow cycle of the field, for a specimen that is
// poled towards +, one that is poled towards -, and one all of whose domains lie at 90 degrees.
#pragma once

#include "model/model.h"
#include "recordings/reports/plot.h"

namespace ferrobench::model {

// `setting` is one of the model's empirical terms. Slow: lags are in equilibrium, and plays have gone round
// once before. The drive knows nothing of fractions, and has one curve.
recordings::Figure picture_of_empirical(const EffectSetting& setting);

}  // namespace ferrobench::model
