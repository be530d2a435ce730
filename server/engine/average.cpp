#include "server/engine/average.h"

#include <boost/uuid/random_generator.hpp>
#include <boost/uuid/uuid_io.hpp>

#include "base/error.h"

namespace ferrobench::server {

recordings::MeanOfPasses average_recording(const recordings::Recording& recording) {
  auto mean = recordings::mean_of_passes(recording);
  if (!mean)
    throw Error(
        ErrorCode::bad_recording, "the recording has no mean",
        Problem{.path = "/entry/protocol",
                .message = "has no averaged repeat of which two passes after the first were played whole",
                .hint = "record with \"average\": true in the protocol's repeat"});
  mean->recording.header.entry_identifier = to_string(boost::uuids::random_generator()());
  return std::move(*mean);
}

}  // namespace ferrobench::server
