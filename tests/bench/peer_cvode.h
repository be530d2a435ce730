// The creep protocol by SUNDIALS CVODE: BDF, Newton with the analytic sparse Jacobian, KLU.
//
// All domains are one system y = (x+_1, x-_1, ..., <x+>, <x->). The means are unknowns of their own, since
// then the stress, which depends on them alone, couples the domains by two columns and two rows only: the
// Jacobian is an arrow, which KLU factors without fill. Rates come from the model's own vector kernel.
#pragma once

#include "tests/bench/creep.h"

namespace ferrobench::bench {

Outputs run_cvode(const Creep& creep, const PeerOptions& options);

}  // namespace ferrobench::bench
