// How a channel is drawn: the label of its axis, and what turns SI into the label's unit.
#pragma once

#include <string>

#include "recordings/format/recording.h"

namespace ferrobench::model {

struct PictureAxis {
  std::string label;
  double scale = 1;
};

inline PictureAxis picture_axis(recordings::Channel channel) {
  switch (channel) {
    case recordings::Channel::charge:
      return {"charge [µC]", 1e6};
    case recordings::Channel::displacement:
      return {"displacement [µm]", 1e6};
    case recordings::Channel::force:
      return {"force [N]", 1};
    default:
      return {"field [kV/mm]", 1e-6};
  }
}

}  // namespace ferrobench::model
