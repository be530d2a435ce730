// The requests of the USB-1608G family, typed. Each is a vendor request to the device on endpoint 0, answered
// within a second and by exactly as many bytes as it has; anything else throws.
#pragma once

#include <array>
#include <memory>
#include <optional>

#include "base/error.h"
#include "daq/usb/link.h"
#include "daq/usb/models.h"

namespace ferrobench::daq::usb {

inline constexpr std::uint8_t input_endpoint = 0x86;                           // bulk, the scan's samples
inline constexpr std::uint8_t output_endpoint = 0x02;                          // bulk, the waveform's samples
inline constexpr std::size_t full_speed_packet = 64, high_speed_packet = 512;  // bytes, bulk

// A request or transfer that failed: what the link said, and the typed error of the bench.
class LinkFailure : public Error {
 public:
  LinkFailure(LinkStatus status, std::string message, std::string hint = {});
  LinkStatus status() const { return status_; }

 private:
  LinkStatus status_;
};

struct UnitStatus {
  std::uint16_t word = 0;
  bool input_running() const { return bit(1); }
  bool input_overrun() const { return bit(2); }
  bool output_running() const { return bit(3); }
  bool output_underrun() const { return bit(4); }
  bool fpga_configured() const { return bit(8); }
  bool fpga_configuring() const { return bit(9); }

 private:
  bool bit(int n) const { return (word >> n & 1) != 0; }
};

enum class InputMode : std::uint8_t { differential, single_ended };
enum class InputRange : std::uint8_t { v10, v5, v2, v1 };
inline constexpr std::size_t range_count = 4;
double full_scale(InputRange range);  // V

// An input of a scan; differential channels are 0..7, single-ended ones 0..15.
struct QueueElement {
  int channel = 0;
  InputRange range = InputRange::v10;
  InputMode mode = InputMode::differential;
};
inline constexpr std::size_t longest_queue = 16;
std::array<std::byte, longest_queue> pack_queue(std::span<const QueueElement> queue);

// period: ticks of the 64 MHz clock from scan to scan, 0 for the external clock.
struct InputScan {
  std::uint64_t period = 0;
  std::size_t packet_samples = 256;  // of one USB packet, 1..256 and no more than the endpoint takes
  bool triggered = false;
};
std::array<std::byte, 15> pack_input_scan(const InputScan& scan);

struct OutputScan {
  std::uint64_t period = 0;
  int channel = 0;
  bool triggered = false;
};
std::array<std::byte, 13> pack_output_scan(const OutputScan& scan);

class Unit {
 public:
  // Throws Error(device_unavailable) for a product that this driver does not speak to, and for endpoints that
  // are not those of one.
  explicit Unit(std::unique_ptr<Link> link);

  const ProductModel& model() const { return *model_; }
  const DeviceId& id() const { return id_; }
  Link& link() { return *link_; }
  // At which speed the unit is attached shows in the packets of its endpoints.
  bool high_speed() const { return packet_bytes_ == high_speed_packet; }
  std::size_t packet_bytes() const { return packet_bytes_; }
  double bus_rate() const;  // bytes/s that the bus carries at most, both ways together

  UnitStatus status();
  void read_memory(std::uint16_t address, std::span<std::byte> data);
  // The image is taken as it is; fpga.h checks it.
  void load_fpga(std::span<const std::byte> image);

  // Digital lines, bit n is DIOn.
  void set_inputs(std::uint8_t mask);  // 1: an input
  void set_latch(std::uint8_t levels);
  std::uint8_t pins();

  // One trigger register serves both scans: a rising edge starts whatever is armed.
  void trigger_on_rising_edge();
  void load_queue(std::span<const QueueElement> queue);
  // One conversion of an element of the queue, while no scan runs.
  std::uint16_t convert(const QueueElement& element);
  void start_input(const InputScan& scan);  // runs until stopped, all channels back to back
  void stop_input();
  void clear_input();
  void start_output(const OutputScan& scan);  // runs until stopped
  void stop_output();
  void clear_output();
  void clear_halts();
  // Refused by the unit while an output scan runs.
  void write_output(int channel, std::uint16_t code);
  // What the output's register holds, or nothing if the unit does not tell.
  std::optional<std::uint16_t> read_output(int channel);

 private:
  // Reads, and writes that may as well come twice, are tried once more.
  enum class Retry { no, once };
  void find_endpoints();
  void write(std::uint8_t request, std::string_view what, std::span<const std::byte> data = {},
             std::uint16_t value = 0, std::uint16_t index = 0, Retry retry = Retry::once);
  void read(std::uint8_t request, std::string_view what, std::span<std::byte> data, std::uint16_t value = 0);

  std::unique_ptr<Link> link_;
  DeviceId id_;
  const ProductModel* model_;
  std::size_t packet_bytes_ = high_speed_packet;
};

}  // namespace ferrobench::daq::usb
