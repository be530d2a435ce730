// A bench on a USB-1608GX-2AO: one analog output to the amplifier, up to four inputs from the monitor and the
// sensors, and a marker.
//
// The output is brought to zero when the device is opened and when it is closed. go_to() writes single
// values, in steps timed by the host, and needs no stream. A unit that went away is looked for again, by its
// serial number, the next time something is asked of it.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "daq/device.h"
#include "daq/usb/amplifier.h"
#include "daq/usb/fpga.h"
#include "daq/usb/stream.h"

namespace ferrobench::daq::usb {

class UsbDevice final : public Device {
 public:
  using Connect = std::function<std::unique_ptr<Link>()>;
  // Throws Error(device_unavailable | device_lost | io_error | invalid_params).
  UsbDevice(const UsbConfig& config, Connect connect, HostClock& clock = HostClock::system(),
            ReadImage read_image = read_fpga_image);
  // Through libusb. Throws Error(invalid_params) for the configuration, too.
  static std::unique_ptr<Device> open(const nlohmann::json& config);
  ~UsbDevice() override;  // the output goes to zero; if it does not, standard error says so

  nlohmann::json info() const override;
  std::vector<recordings::RawColumn> columns() const override;
  std::array<std::optional<double>, 5> noise() const override;
  OutputRange output_range() const override { return amplifier_.range(); }
  double fastest_slew() const override {
    return config_.amplifier.slew_limit / config_.specimen.layer_thickness;
  }
  double scan_rate(double asked) const override;
  std::vector<Problem> problems(const protocols::SampledWaveform& program) const override;
  std::optional<recordings::Specimen> specimen() const override { return to_recording(config_.specimen); }
  recordings::LoadCase load() const override { return to_recording(config_.load); }
  bool interlock_closed() override;

  // NaN while a stream runs, and after one that failed, until go_to() has brought it somewhere.
  double output() const override;
  void go_to(double level, double slew) override;
  void start(double rate, LevelSource& source) override;
  bool read(SampleBlock& block) override;

 private:
  void connect();
  void set_up();
  void disconnect();
  void ensure_connected();
  void set_up_lines();
  void set_latch(std::uint8_t levels);
  void enable_amplifier();
  void disable_amplifier() noexcept;
  void end_stream();
  void settle(const Rest& rest);
  void write_level(double level);
  void ramp(double level, double slew);
  std::uint16_t code(double level) const;
  double fastest_rate() const;
  double stop_slew() const;

  UsbConfig config_;
  Connect connect_;
  ReadImage read_image_;
  HostClock& clock_;
  Amplifier amplifier_;
  Transfers transfers_;  // outlives the link
  std::unique_ptr<Unit> unit_;
  Calibration calibration_;
  std::optional<Inputs> inputs_;
  DeviceId id_;
  const ProductModel* model_ = nullptr;
  bool fpga_loaded_ = false;
  bool high_speed_ = true;
  double bus_rate_ = 0;  // bytes/s

  double level_ = 0;    // V/m, what the output was last seen or set at
  bool known_ = false;  // else level_ is a guess
  bool lost_ = false;   // the unit is gone or does not answer
  std::uint8_t latch_ = 0;
  Pace pace_;
  double asked_ = 0;  // Hz
  std::unique_ptr<Stream> stream_;
};

}  // namespace ferrobench::daq::usb
