#include "model/physics/mechanics-inl.h"

namespace ferrobench::model {

template class Mechanics<double>;
template class Mechanics<DualNumber>;

}  // namespace ferrobench::model
