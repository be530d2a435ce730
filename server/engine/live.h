// What goes by, for those who watch: first, smallest and largest value of each channel over stretches of
// rows, few enough to draw.
//
// The topic "samples": {run, measured, columns: {time: [..], command: {first: [..], min: [..], max: [..]},
// ..}}, SI units; a time is that of the first row of its stretch. `measured` is the moment of the last row by
// this machine's clock, as it was seen in the journal: late by the 12 ms between two looks at most, unless
// the disk or the machine is slow. Messages merge by joining their stretches; where there would be more than
// max_bins, neighbours are joined by the rule of thinning.h.
#pragma once

#include <chrono>
#include <span>
#include <string>

#include "recordings/format/parts.h"
#include "server/rpc/hub.h"
#include "server/rpc/pace.h"

namespace ferrobench::server {

inline constexpr std::size_t max_bins = 200;

Topic samples_topic();
// Over the stretches that begin with these rows (thinning.h).
nlohmann::json decimate(const recordings::Rows& rows, std::span<const std::size_t> begins);
void merge_samples(nlohmann::json& held, const nlohmann::json& next);

// One run's stream into the hub, at most 30 messages a second however fast the rows come.
class LiveStream {
 public:
  LiveStream(Hub& hub, std::string run) : hub_(hub), run_(std::move(run)) {}
  void add(const recordings::Rows& rows);
  void finish();

 private:
  void send();

  Hub& hub_;
  std::string run_;
  nlohmann::json held_;
  // 40 a second: a page that draws one picture late now and then still draws 30.
  Pace pace_{std::chrono::milliseconds(25)};
};

}  // namespace ferrobench::server
