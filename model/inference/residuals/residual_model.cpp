#include "model/inference/residuals/residual_model.h"

#include "model/inference/residuals/separable.h"

namespace ferrobench::model {

std::unique_ptr<Separable> ResidualModel::separable(const Model&, const std::vector<FreeParameter>&) const {
  return nullptr;
}

}  // namespace ferrobench::model
