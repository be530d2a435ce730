#include "model/inference/report/fit_verdict.h"

#include <fmt/format.h>

#include <algorithm>

#include "model/inference/observation/noise.h"
#include "recordings/analysis/statistics.h"

namespace ferrobench::model {
namespace {

// What a miss may be of the noise and still count as such: an estimate of noise is good to a tenth or two,
// and of a bench that is simulated itself the fits at hand leave up to 1.7.
constexpr double as_noise = 2;

}  // namespace

NoiseByChannel noise_of(const recordings::Recording& recording) {
  NoiseByChannel out{};
  for (const auto channel : predicted_channels) {
    const auto index = static_cast<std::size_t>(channel);
    if (recording.has(channel))
      out.at(index) = recording.noise.at(index).value_or(recordings::estimate_noise(recording.at(channel)));
  }
  return out;
}

std::string FitVerdict::text() const {
  std::string out;
  const bool more_than_noise = times_noise && *times_noise > as_noise;
  if (times_noise)
    out = more_than_noise
              ? fmt::format("The model misses the measurement by up to {:.{}f} times its noise ({}). ",
                            *times_noise, *times_noise < 10 ? 1 : 0, where)
              : fmt::format(
                    "The model explains the measurement to its noise: what is left is at most {:.1f} times "
                    "that ({}). ",
                    *times_noise, where);
  if (!intervals_hold())
    return out +
           fmt::format(
               "{} of {} parameters ended at a bound of their range, so that the 95 % intervals are not to "
               "be trusted: search from more starts (--starts), or take another model (--model).",
               at_bound, parameters);
  out += "No parameter ended at a bound of its range.";
  if (more_than_noise)
    out +=
        " More starts (--starts) may find a better place; else the model lacks something, which discover "
        "looks for.";
  return out;
}

FitVerdict judge(const FitResult& result, const ResidualModel& residuals,
                 std::span<const std::pair<std::string, double>> after,
                 std::span<const NoiseByChannel> noise) {
  FitVerdict out;
  out.parameters = static_cast<int>(result.parameters.size());
  out.at_bound = static_cast<int>(std::ranges::count_if(result.parameters, &FittedParameter::at_bound));
  // The parts of recordings are their columns, one after the other, in percent of the range.
  const auto recordings = residuals.recordings();
  std::size_t part = 0;
  for (std::size_t r = 0; r < recordings.size(); ++r)
    for (const auto& column : recordings[r].columns) {
      const double share = noise[r].at(static_cast<std::size_t>(column.channel)) / column.range;
      const double times = after[part].second / (100 * std::max(share, inference::smallest_noise));
      if (!out.times_noise || times > *out.times_noise) {
        out.times_noise = times;
        out.where = residuals.parts()[part].name;
      }
      ++part;
    }
  return out;
}

}  // namespace ferrobench::model
