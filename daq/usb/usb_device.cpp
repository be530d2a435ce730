#include "daq/usb/usb_device.h"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>

#include "base/fields.h"
#include "daq/not_at_zero.h"
#include "daq/usb/units.h"

namespace ferrobench::daq::usb {

namespace {

constexpr std::chrono::milliseconds ramp_step{1};
// A host that was away for longer goes on as if it had been this long, so no step is larger: what comes late
// and what it missed stand within a tenth of the slew in any 50 ms.
constexpr double longest_ramp_step = 0.004;  // s

std::string number(double value) {
  return nlohmann::json(value).dump();
}

}  // namespace

UsbDevice::UsbDevice(const UsbConfig& config, Connect connect, HostClock& clock, ReadImage read_image)
    : config_(config),
      connect_(std::move(connect)),
      read_image_(std::move(read_image)),
      clock_(clock),
      amplifier_(config.amplifier, config.specimen) {
  this->connect();
}

std::unique_ptr<Device> UsbDevice::open(const nlohmann::json& config) {
  const auto settings = usb_config_from_json(config);
  return std::make_unique<UsbDevice>(settings,
                                     [serial = settings.serial_number] { return open_unit(serial); });
}

UsbDevice::~UsbDevice() {
  try {
    end_stream();
    if (!(known_ && level_ == 0)) go_to(0, stop_slew());
    set_latch(0);
  } catch (const std::exception& failure) {
    std::cerr << "ferrobench: USB unit " << id_.serial << ": " << not_at_zero(failure.what()) << '\n';
    disable_amplifier();
  }
}

void UsbDevice::disconnect() {
  unit_.reset();
  transfers_.forget();
  lost_ = true;
}

void UsbDevice::connect() {
  disconnect();
  unit_ = std::make_unique<Unit>(connect_());
  id_ = unit_->id();
  model_ = &unit_->model();
  high_speed_ = unit_->high_speed();
  bus_rate_ = unit_->bus_rate();
  if (model_->outputs == 0)
    throw Error(ErrorCode::device_unavailable,
                "unit " + id_.serial + " is a " + std::string(model_->name) + ", which has no analog output",
                Problem{.path = "/serial_number",
                        .given = id_.serial,
                        .allowed = "USB-1608GX-2AO",
                        .hint = "it can measure but not drive a specimen; name a unit with outputs"});
  bool drives = true;
  try {
    drives = unit_->status().fpga_configured();  // without that it has just got its power and is at 0 V
    set_up();
  } catch (const Error& failure) {
    if (!drives) throw;
    disable_amplifier();
    throw Error(failure.code(), not_at_zero("unit " + id_.serial + ": " + failure.message()),
                failure.problems());
  }
  lost_ = false;
}

void UsbDevice::set_up() {
  fpga_loaded_ = ensure_fpga(*unit_, config_.fpga_image, read_image_);
  unit_->stop_output();
  unit_->stop_input();
  calibration_ = read_calibration(*unit_);
  amplifier_ = Amplifier(config_.amplifier, config_.specimen,
                         calibration_.output_reach(static_cast<int>(config_.output_channel)));
  inputs_.emplace(config_, calibration_);
  // The first conversion after the FPGA was loaded is garbage, whoever loaded it: nobody is to see it.
  unit_->load_queue(inputs_->queue());
  unit_->convert(inputs_->queue().back());
  // Whoever had the unit before may have left a voltage there.
  const auto code = unit_->read_output(static_cast<int>(config_.output_channel));
  level_ =
      code ? amplifier_.field(calibration_.output_volts(static_cast<int>(config_.output_channel), *code)) : 0;
  known_ = false;
  set_up_lines();
  ramp(0, stop_slew());
}

void UsbDevice::set_up_lines() {
  unsigned outputs = 0;
  if (config_.start.mode == StartMode::trigger) outputs |= 1;
  if (config_.amplifier.enable_bit) outputs |= 1u << *config_.amplifier.enable_bit;
  set_latch(0);
  unit_->set_inputs(static_cast<std::uint8_t>(~outputs));
}

void UsbDevice::set_latch(std::uint8_t levels) {
  if (!unit_) return;
  unit_->set_latch(levels);
  latch_ = levels;
}

void UsbDevice::enable_amplifier() {
  if (!config_.amplifier.enable_bit) return;
  const auto bit = 1u << *config_.amplifier.enable_bit;
  if ((latch_ & bit) == 0) set_latch(static_cast<std::uint8_t>(latch_ | bit));
}

// The last resort: its line may still obey.
void UsbDevice::disable_amplifier() noexcept {
  try {
    set_latch(0);
  } catch (const std::exception&) {  // what went wrong before is told
  }
}

void UsbDevice::ensure_connected() {
  if (lost_ || !unit_) connect();
}

std::uint16_t UsbDevice::code(double level) const {
  const auto range = amplifier_.range();
  return calibration_.code(static_cast<int>(config_.output_channel),
                           amplifier_.output_volts(std::clamp(level, range.min, range.max)));
}

double UsbDevice::fastest_rate() const {
  const auto width = static_cast<double>(inputs_->width());
  constexpr double sample_bytes = 2;
  return std::min(
      {model_->input_rate / width, model_->output_rate, bus_rate_ / (sample_bytes * (width + 1))});
}

double UsbDevice::stop_slew() const {
  return config_.amplifier.stop_slew / config_.specimen.layer_thickness;
}

nlohmann::json UsbDevice::info() const {
  nlohmann::json channels = nlohmann::json::array();
  std::size_t place = 0;
  for (const auto& c : inputs_->columns()) {
    channels.push_back({{"channel", recordings::channel_name(c.column.channel)},
                        {"unit", recordings::channel_unit(c.column.channel)},
                        {"input", c.element.channel},
                        {"range_V", full_scale(c.element.range)},
                        {"lsb", c.column.gain},
                        {"offset", c.column.offset},
                        {"linearized", !c.by_code.empty()},
                        {"skew_s", static_cast<double>(place++) / model_->input_rate}});
    if (c.gain_uncertainty) channels.back()["gain_uncertainty"] = *c.gain_uncertainty;
  }
  const auto range = amplifier_.range();
  nlohmann::json out{{"driver", "usb"},
                     {"product", model_->name},
                     {"serial_number", id_.serial},
                     {"firmware", id_.firmware},
                     {"link_speed", high_speed_ ? "high" : "full"},
                     {"clock", "real"},
                     {"resolution_bits", 16},
                     {"fpga_loaded", fpga_loaded_},
                     {"output_range", {{"min", range.min}, {"max", range.max}, {"unit", "V/m"}}},
                     {"row_rate", {{"min", slowest_row_rate}, {"max", fastest_rate()}, {"unit", "Hz"}}},
                     {"calibration", to_json(calibration_)},
                     {"channels", std::move(channels)},
                     {"configuration", write_json(config_)}};
  if (asked_ > 0) {
    out["scan_rate"] = pace_.row_rate();
    out["tick_rate"] = pace_.tick_rate();
    out["oversampling"] = pace_.oversampling;
  }
  return out;
}

std::vector<recordings::RawColumn> UsbDevice::columns() const {
  std::vector<recordings::RawColumn> out;
  for (const auto& c : inputs_->columns()) out.push_back(c.column);
  return out;
}

std::array<std::optional<double>, 5> UsbDevice::noise() const {
  std::array<std::optional<double>, 5> out;
  for (const auto& c : inputs_->columns()) out[static_cast<std::size_t>(c.column.channel)] = c.noise;
  return out;
}

double UsbDevice::scan_rate(double asked) const {
  if (asked >= slowest_row_rate && asked <= fastest_rate())
    return pace_for(asked, config_.update_rate, fastest_rate()).row_rate();
  throw Error(ErrorCode::invalid_params, "the USB device cannot scan at this rate",
              Problem{.path = "/sample_rate",
                      .message = "with " + std::to_string(inputs_->width()) + " inputs is outside its range",
                      .given = asked,
                      .allowed = {{"from", slowest_row_rate}, {"to", fastest_rate()}},
                      .unit = "Hz",
                      .hint = "choose a rate in the range, or measure fewer signals"});
}

std::vector<Problem> UsbDevice::problems(const protocols::SampledWaveform& program) const {
  return check_amplifier(program, config_.amplifier, config_.specimen, amplifier_.range());
}

bool UsbDevice::interlock_closed() {
  if (!config_.amplifier.interlock_bit) return true;
  if (stream_) return stream_->interlock_closed();
  ensure_connected();
  return (unit_->pins() >> *config_.amplifier.interlock_bit & 1) != 0;
}

double UsbDevice::output() const {
  return !stream_ && known_ ? level_ : std::numeric_limits<double>::quiet_NaN();
}

// The unit's own account of where the output is counts if it can be true.
void UsbDevice::settle(const Rest& rest) {
  known_ = rest.known;
  level_ = rest.level;
  if (!rest.transfers_back || rest.lost) {
    known_ = false;
    disconnect();
    return;
  }
  if (known_) return;
  const auto code = unit_->read_output(static_cast<int>(config_.output_channel));
  if (!code) return;
  const double level =
      amplifier_.field(calibration_.output_volts(static_cast<int>(config_.output_channel), *code));
  const double step = std::abs(amplifier_.field(output_full_scale)) / 32768;
  if (level >= rest.lowest - step && level <= rest.highest + step) level_ = level;
}

void UsbDevice::end_stream() {
  if (!stream_) return;
  const auto rest = stream_->end();
  stream_.reset();
  settle(rest);
}

void UsbDevice::write_level(double level) {
  const int channel = static_cast<int>(config_.output_channel);
  try {
    unit_->write_output(channel, code(level));
  } catch (const LinkFailure& failure) {
    if (failure.status() != LinkStatus::stall) throw;
    unit_->stop_output();  // a scan that still runs keeps single values out
    unit_->write_output(channel, code(level));
  }
  level_ = level;
}

void UsbDevice::ramp(double level, double slew) {
  known_ = false;
  if (level_ != level) write_level(level_);
  auto last = clock_.now();
  while (level_ != level) {
    clock_.sleep_for(ramp_step);
    const auto now = clock_.now();
    const double passed = std::min(std::chrono::duration<double>(now - last).count(), longest_ramp_step);
    last = now;
    const double next = std::clamp(level, level_ - slew * passed, level_ + slew * passed);
    if (next != level && code(next) == code(level_)) {
      level_ = next;
      continue;
    }
    write_level(next);
  }
  write_level(level);
  known_ = true;
}

void UsbDevice::go_to(double level, double slew) {
  if (!(slew > 0) || !std::isfinite(level))
    throw Error(ErrorCode::invalid_params, "the output needs a level and a slew above zero",
                Problem{.path = "/slew", .given = slew, .unit = "V/m/s"});
  end_stream();
  const double from = level_;
  try {
    ensure_connected();
    if (level != 0) enable_amplifier();
    ramp(level, slew);
  } catch (const Error& failure) {
    if (const auto* link = dynamic_cast<const LinkFailure*>(&failure);
        link != nullptr && link->status() == LinkStatus::no_device)
      lost_ = true;
    known_ = false;
    if (level == 0) disable_amplifier();
    throw Error(ErrorCode::device_lost,
                "the output could not be brought from " + number(from) + " to " + number(level) +
                    " V/m, it was last at " + number(level_) + " V/m (" +
                    number(amplifier_.output_volts(level_)) + " V at the unit): " + failure.message(),
                failure.problems());
  }
}

void UsbDevice::start(double rate, LevelSource& source) {
  end_stream();
  const double real = scan_rate(rate);
  ensure_connected();
  if (!known_)
    throw Error(ErrorCode::bad_state, "the output is not where it is known to be",
                Problem{.hint = "go_to() a level first"});
  asked_ = rate;
  pace_ = pace_for(real, config_.update_rate, fastest_rate());
  enable_amplifier();
  StreamPlan plan{.pace = pace_,
                  .start = config_.start,
                  .monitor_check = config_.monitor_check,
                  .queue_ahead = config_.queue_ahead,
                  .level = level_,
                  .output_channel = static_cast<int>(config_.output_channel),
                  .latch = latch_,
                  .interlock_bit = std::nullopt};
  if (config_.amplifier.interlock_bit)
    plan.interlock_bit = static_cast<int>(*config_.amplifier.interlock_bit);
  Rest rest;
  try {
    stream_ = std::make_unique<Stream>(
        *unit_, transfers_, *inputs_, plan, source, [this](double level) { return code(level); }, clock_,
        rest);
  } catch (...) {
    settle(rest);
    throw;
  }
}

bool UsbDevice::read(SampleBlock& block) {
  if (stream_ && stream_->read(block)) return true;
  block.rows = 0;
  block.counts.clear();
  end_stream();
  return false;
}

}  // namespace ferrobench::daq::usb
