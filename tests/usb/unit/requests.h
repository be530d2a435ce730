// Numbers of the wire protocol: vendor requests, option bits, status bits, sizes (protocol note 1 to 8).
#pragma once

#include <cstddef>
#include <cstdint>

namespace ferrobench::emulator {

namespace request {
inline constexpr std::uint8_t tristate = 0x00, pins = 0x01, latch = 0x02, input_value = 0x10,
                              input_start = 0x12, input_stop = 0x13, queue = 0x14, input_clear = 0x15,
                              output_value = 0x18, output_start = 0x1A, output_stop = 0x1B,
                              output_clear = 0x1C, counter = 0x20, timer_control = 0x28,
                              timer_parameters = 0x2D, memory = 0x30, memory_address = 0x31, status = 0x40,
                              blink = 0x41, reset = 0x42, trigger = 0x43, calibration_source = 0x44,
                              temperature = 0x45, serial = 0x48, fpga_configure = 0x50, fpga_data = 0x51,
                              fpga_version = 0x52;
}  // namespace request

namespace status_bit {
inline constexpr std::uint16_t input_running = 1U << 1, overrun = 1U << 2, output_running = 1U << 3,
                               underrun = 1U << 4, input_done = 1U << 5, output_done = 1U << 6,
                               fpga_configured = 1U << 8, fpga_configuring = 1U << 9;
}  // namespace status_bit

namespace input_option {
inline constexpr std::uint8_t burst = 1U << 0, trigger = 1U << 3, retrigger = 1U << 6;
}
namespace output_option {
inline constexpr std::uint8_t channels = 3, trigger = 1U << 4, retrigger = 1U << 5;
}

inline constexpr std::uint16_t vendor_id = 0x09DB;
inline constexpr std::uint8_t input_endpoint = 0x86, output_endpoint = 0x02;
inline constexpr std::size_t input_fifo_samples = 4096;   // 8 KiB
inline constexpr std::size_t output_fifo_samples = 2048;  // 4 KiB
inline constexpr std::uint8_t vendor_out = 0x40, vendor_in = 0xC0;
inline constexpr std::uint8_t fpga_key = 0xAD;

}  // namespace ferrobench::emulator
