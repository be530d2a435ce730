#include "daq/device_facts.h"

namespace ferrobench::daq {

DeviceFacts facts_of(const Device& device) {
  return {.info = device.info(),
          .columns = device.columns(),
          .signals = device.signals(),
          .noise = device.noise(),
          .model = device.model(),
          .output_range = device.output_range(),
          .specimen = device.specimen(),
          .load = device.load(),
          .past = device.past(),
          .output = device.output()};
}

}  // namespace ferrobench::daq
