// A configuration, a program and a device on a fake unit, for the tests.
#pragma once

#include <vector>

#include "daq/usb/usb_device.h"
#include "tests/daq/usb/fake_unit.h"

namespace ferrobench::daq::usb {

// 20 V/V on layers of 100 um: 1 V of the unit is 2e5 V/m, +-10 V is +-2e6 V/m. The monitor shows the unit's
// own voltage. Inputs in a tick: field, charge, displacement, marker.
inline nlohmann::json bench_json() {
  return {{"update_rate", 2000},
          {"amplifier",
           {{"gain", 20},
            {"voltage_min", -200},
            {"voltage_max", 200},
            {"monitor_ratio", 20},
            {"current_limit", 0.1},
            {"slew_limit", 2e5}}},
          {"specimen", {{"length", 0.02}, {"area", 25e-6}, {"layer_thickness", 1e-4}, {"capacitance", 1e-6}}},
          {"field", {{"channel", 0}}},
          {"charge", {{"channel", 1}, {"sensitivity", 1e5}}},
          {"displacement", {{"channel", 2}, {"sensitivity", 2e5}}},
          {"marker", {{"channel", 3}, {"level", 5}, {"tolerance", 0.1}}},
          {"monitor_check", {{"tolerance", 2e4}}}};
}

// Pieces one after the other.
class Pieces final : public LevelSource {
 public:
  explicit Pieces(std::vector<LinearPiece> pieces) : pieces_(std::move(pieces)) {}
  LinearPiece next(std::uint64_t most) override {
    if (at_ == pieces_.size()) return {};
    auto& piece = pieces_[at_];
    const auto count = std::min(most, piece.samples);
    level_ += (piece.level - level_) * static_cast<double>(count) / static_cast<double>(piece.samples);
    piece.samples -= count;
    if (piece.samples == 0) level_ = pieces_[at_++].level;
    return {.samples = count, .level = level_};
  }

 private:
  std::vector<LinearPiece> pieces_;
  std::size_t at_ = 0;
  double level_ = 0;
};

struct Bench {
  explicit Bench(nlohmann::json config = bench_json()) : json(std::move(config)) { calibrate(state); }

  UsbDevice& device() {
    if (!device_)
      device_ = std::make_unique<UsbDevice>(
          usb_config_from_json(json),
          [this]() -> std::unique_ptr<Link> {
            if (state.gone) throw Error(ErrorCode::device_unavailable, "no unit is attached");
            return std::make_unique<FakeUnit>(state);
          },
          state.clock);
    return *device_;
  }
  void close() { device_.reset(); }

  struct Result {
    std::vector<std::int16_t> counts;
    std::uint64_t rows = 0;
    BlockStatus status = BlockStatus::ok;  // of the last block
    std::string message;
    bool in_order = true;
  };
  // Plays until the device says that it is over.
  Result play(double rate, std::vector<LinearPiece> pieces) {
    Pieces source(std::move(pieces));
    Result out;
    device().start(device().scan_rate(rate), source);
    SampleBlock block;
    while (device().read(block)) {
      if (block.rows > 0 && block.first_sample != out.rows) out.in_order = false;
      out.rows += block.rows;
      out.counts.insert(out.counts.end(), block.counts.begin(), block.counts.end());
      out.status = block.status;
      out.message = block.message;
    }
    return out;
  }

  nlohmann::json json;
  FakeState state;

 private:
  std::unique_ptr<UsbDevice> device_;
};

}  // namespace ferrobench::daq::usb
