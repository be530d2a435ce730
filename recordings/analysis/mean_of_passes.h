// The mean over the passes of a repeat that its protocol says to average (protocols/segments.h).
//
// The first pass brings the specimen into the loop and has no part in it. Of each segment, passes are put on
// the samples of the first one in the mean, by the share of the segment that has gone by, linear between
// samples:
//
//   mean(t) = sum of x_k(t) / m,  k = 1 .. m
//
// Its noise is the scatter s of the passes about the mean, each less its own mean distance from it, which is
// drift and no noise:
//
//   u^2 = s^2 / m,  s^2 = sum over t and k of (x_k(t) - mean(t) - d_k)^2 / (n (m - 1))
//
// (JCGM 100:2008, 4.2, evaluation of type A).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "recordings/format/recording.h"

namespace ferrobench::recordings {

struct MeanOfPasses {
  // One pass that begins at time 0, with a protocol of its own and the past that the specimen had by then.
  // The identifier is the one of the recording that it was made of, which the device's `mean_of` names, too.
  // It has no counts; where some of a channel were clipped, an event says so.
  Recording recording;
  std::vector<std::size_t> passes;    // that have a part in it, from 2 on
  std::vector<std::string> left_out;  // and why others have none, a sentence each
  std::string in_words() const;       // "passes 2 to 10", "passes 2, 4 and 5"
};

// None if no repeat is averaged, or fewer than two passes after the first were played whole and alike. Takes
// as long as expanding the protocol does, at the least.
std::optional<MeanOfPasses> mean_of_passes(const Recording& recording);

}  // namespace ferrobench::recordings
