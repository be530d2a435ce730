// How measurement and models are drawn over each other: what was measured is grey, and a model has one colour
// in all pictures.
#pragma once

#include "recordings/reports/plot.h"

namespace ferrobench::model {

inline recordings::Series measured_curve() {
  return {.label = "measured", .points = {}, .quiet = true};
}
inline recordings::Series curve_before() {
  return {.label = "before", .points = {}, .value = 0};
}
inline recordings::Series curve_after() {
  return {.label = "after", .points = {}, .value = 1};
}

}  // namespace ferrobench::model
