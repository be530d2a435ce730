#include "daq/guard/limits.h"

#include <algorithm>

namespace ferrobench::daq {

std::vector<Problem> problems(const Limits& limits) {
  std::vector<Problem> out;
  Limits checked;
  read_json(write_json(limits), checked, "", out);

  const auto demand = [&out](bool fine, const char* path, const char* message, double given,
                             const nlohmann::json& bound, const char* unit, const char* hint) {
    if (!fine)
      out.push_back(
          {.path = path, .message = message, .given = given, .allowed = bound, .unit = unit, .hint = hint});
  };
  demand(limits.field_min < limits.field_max, "/field_max", "must be above field_min", limits.field_max,
         limits.field_min, "V/m", "the range holds zero, the safe state, and something to play");
  demand(limits.stop_slew <= limits.slew, "/stop_slew", "must not be above slew", limits.stop_slew,
         limits.slew, "V/m/s", "a safe stop is no steeper than the rest");
  const double farthest = std::max(-limits.field_min, limits.field_max);
  demand(farthest <= limits.stop_slew * limits.stop_time * (1 + 1e-9), "/stop_slew",
         "is too slow: a stop from the largest field would take longer than stop_time", limits.stop_slew,
         {{"from", farthest / limits.stop_time}}, "V/m/s", "raise stop_slew, or lower the field limits");
  demand(limits.displacement_min < limits.displacement_max, "/displacement_max",
         "must be above displacement_min", limits.displacement_max, limits.displacement_min, "m", "");
  demand(limits.force_min < limits.force_max, "/force_max", "must be above force_min", limits.force_max,
         limits.force_min, "N", "");
  return out;
}

Limits limits_from_json(const nlohmann::json& json) {
  Limits limits;
  std::vector<Problem> found;
  read_json(json, limits, "", found);
  if (found.empty()) found = problems(limits);
  if (!found.empty()) throw Error(ErrorCode::invalid_params, "the limits are not valid", std::move(found));
  return limits;
}

}  // namespace ferrobench::daq
