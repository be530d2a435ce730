// What a device says of itself, for those who have not the device: a program is planned and a recording begun
// by it.
#pragma once

#include "daq/device.h"

namespace ferrobench::daq {

// As the functions of the same names in Device say.
struct DeviceFacts {
  nlohmann::json info{};
  std::vector<recordings::RawColumn> columns{};
  std::vector<recordings::Channel> signals{};
  std::array<std::optional<double>, 5> noise{};
  nlohmann::json model{};
  OutputRange output_range{};
  std::optional<recordings::Specimen> specimen{};
  recordings::LoadCase load{};
  protocols::Past past{};
  double output = 0;  // V/m
};

DeviceFacts facts_of(const Device& device);

}  // namespace ferrobench::daq
