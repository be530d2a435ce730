// libFuzzer's way into a session.
#include <cstdint>

#include "tests/daq/usb/session.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  ferrobench::daq::usb::run_session(std::as_bytes(std::span(data, size)));
  return 0;
}
