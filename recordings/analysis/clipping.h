// Samples that a converter could not follow: their counts lie at its limits, so what was there is not known.
//
// Where a channel has no counts, the recording's "clipped" events say when; each begins with the channel's
// name.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "recordings/format/recording.h"

namespace ferrobench::recordings {

class Clipping {
 public:
  explicit Clipping(const Recording& recording);

  // Is one of the samples first..last of one of these channels clipped?
  bool any(std::span<const Channel> channels, std::size_t first, std::size_t last) const;
  // "displacement: 120 samples from 1.5 s to 3 s"
  std::string in_words(Channel channel) const;

 private:
  struct Stretch {
    std::size_t first, last;
  };
  const Recording& recording_;
  std::array<std::vector<Stretch>, 5> stretches_;  // by Channel, in order
};

}  // namespace ferrobench::recordings
