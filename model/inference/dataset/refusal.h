// How a recording that cannot be compared with a model is refused: by name, with the channel at fault.
#pragma once

#include <string>

#include "recordings/format/recording.h"

namespace ferrobench::model::inference {

inline std::string channel_path(recordings::Channel channel) {
  return "/entry/data/" + std::string(recordings::channel_name(channel));
}

// Throws Error(bad_recording).
[[noreturn]] inline void refuse(const std::string& recording, const std::string& path,
                                const std::string& message, const std::string& hint = "") {
  throw Error(ErrorCode::bad_recording, "the recording " + recording + " cannot be used",
              Problem{.path = path, .message = message, .hint = hint});
}

}  // namespace ferrobench::model::inference
