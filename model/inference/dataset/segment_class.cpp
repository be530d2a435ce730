#include "model/inference/dataset/segment_class.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "model/inference/dataset/bench.h"
#include "model/inference/dataset/recording_data.h"
#include "model/on_recording.h"

namespace ferrobench::model::inference {
namespace {

using recordings::Channel;

struct Leg {
  double begin = 0, end = 0, slope = 0, level = 0;
};

// Ramps and holds; chords of a bent program that go on in the same direction make one ramp.
std::vector<Leg> legs_of(const BenchRecording& r) {
  std::vector<Leg> out;
  const double largest = std::max(1e-300, largest_field(r.knot_field));
  for (std::size_t k = 1; k < r.knot_time.size(); ++k) {
    const double span = r.knot_time[k] - r.knot_time[k - 1];
    const double change = r.knot_field[k] - r.knot_field[k - 1];
    const double slope = std::abs(change) < 1e-6 * largest ? 0 : change / span;
    if (!out.empty() && ((slope > 0 && out.back().slope > 0) || (slope < 0 && out.back().slope < 0) ||
                         (slope == 0 && out.back().slope == 0)))
      out.back().end = r.knot_time[k];
    else
      out.push_back({r.knot_time[k - 1], r.knot_time[k], slope, r.knot_field[k]});
  }
  return out;
}

}  // namespace

// A row switches where the model's charge moves clearly more than permittivity alone would have it.
void classify_segments(BenchRecording& r, const Model& model, const SimulationOptions& roughly) {
  auto with_charge = r;
  with_charge.channels = {{.channel = Channel::charge, .value = std::vector<double>(r.time.size())},
                          {.channel = Channel::field, .value = std::vector<double>(r.time.size())}};
  const auto simulated = simulate_bench(model, with_charge, roughly);
  const auto m = model_for(model, r.header);
  const double reversible = 2 * std::max(model.material.permittivity_180, model.material.permittivity_90) *
                            m.actuator.area * static_cast<double>(m.actuator.layer_count);
  const double largest = *std::max_element(r.knot_field.begin(), r.knot_field.end(),
                                           [](double a, double b) { return std::abs(a) < std::abs(b); });
  const auto legs = legs_of(r);
  r.segment_class.assign(r.time.size(), SegmentClass::rest);
  std::size_t row = 0;
  for (std::size_t l = 0; l < legs.size(); ++l) {
    const auto& leg = legs[l];
    const bool last = l + 1 == legs.size();
    const bool turned = l > 0 && leg.slope * legs[l - 1].slope < 0;
    bool switched = false;
    for (; row < r.time.size() && (last || r.time[row] < leg.end); ++row) {
      const double since = (r.time[row] - leg.begin) / (leg.end - leg.begin);
      if (leg.slope == 0) {
        r.segment_class[row] = std::abs(leg.level) < 0.01 * std::abs(largest) ? SegmentClass::rest
                               : since < 0.1                                  ? SegmentClass::hold_early
                                                                              : SegmentClass::hold_late;
        continue;
      }
      const std::size_t before = row > 0 ? row - 1 : row;
      const double moved = std::abs(simulated[0][row] - simulated[0][before]);
      const bool switching =
          moved > reversible * std::abs(simulated[1][row] - simulated[1][before]) && row != before;
      switched = switched || switching;
      r.segment_class[row] = switching                ? SegmentClass::ramp_switching
                             : turned && since < 0.15 ? SegmentClass::after_reversal
                             : switched               ? SegmentClass::ramp_after_switching
                                                      : SegmentClass::ramp_before_switching;
    }
  }
}

std::string_view segment_class_name(SegmentClass segment) {
  constexpr std::array<std::string_view, segment_class_count> names{"rest",
                                                                    "hold, early",
                                                                    "hold, late",
                                                                    "after reversal",
                                                                    "ramp, before switching",
                                                                    "ramp, switching",
                                                                    "ramp, after switching"};
  return names.at(static_cast<std::size_t>(segment));
}

}  // namespace ferrobench::model::inference
