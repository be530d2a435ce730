// A protocol is refused, or it can be read again from what was read, and its samples are finite and within
// the range that it states.
#include "protocols/protocol.h"

#include <cmath>

#include "input.h"
#include "protocols/csv.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace ferrobench;
  const auto text = fuzz::text_of(data, size);
  std::vector<Problem> problems;
  protocols::read_points(text, "", std::nullopt, problems);
  try {
    const auto protocol = protocols::Protocol::from_text(text);
    fuzz::demand(protocols::Protocol::from_json(protocol.json()).json() == protocol.json(), "the same again");
    const auto waveform = protocol.expand({.layer_thickness = 1e-4});
    const double duration = waveform.duration(), slack = 1e-9 * (waveform.maximum() - waveform.minimum());
    fuzz::demand(std::isfinite(duration) && duration > 0, "the duration is positive");
    const protocols::SampledWaveform samples(waveform, 100 / duration);
    const auto count = samples.size();
    fuzz::demand(count >= 2, "there are samples");
    for (std::uint64_t i = 0; i < 100; ++i) {
      const double level = samples.value(i * (count - 1) / 99);
      fuzz::demand(level >= waveform.minimum() - slack && level <= waveform.maximum() + slack,
                   "a level is within the range");
    }
  } catch (const Error&) {
  }
  return 0;
}
