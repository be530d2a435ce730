#include "daq/usb/calibration.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "daq/usb/little_endian.h"

namespace ferrobench::daq::usb {

namespace {

constexpr std::uint16_t input_address = 0x7000;
constexpr std::uint16_t output_address = 0x7080;
constexpr double half_scale = 32768;  // codes
constexpr double smallest_slope = 0.9, largest_slope = 1.2;
constexpr double largest_offset = 10'000;  // codes

std::string address_text(unsigned address) {
  std::array<char, 16> text{};
  static_cast<void>(std::snprintf(text.data(), text.size(), "0x%04X", address));
  return text.data();
}

// A JSON number cannot be NaN, so the text of it.
nlohmann::json number_or_text(float value) {
  return std::isfinite(value) ? nlohmann::json(value) : nlohmann::json(std::to_string(value));
}

std::vector<Problem> read_pairs(Unit& unit, std::uint16_t address, std::span<CodeCorrection> pairs) {
  constexpr std::size_t pair_bytes = 8;
  std::vector<std::byte> bytes(pairs.size() * pair_bytes);
  unit.read_memory(address, bytes);
  std::vector<Problem> problems;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const auto at = i * pair_bytes;
    const float slope = load_float(std::span(bytes).subspan(at, 4));
    const float offset = load_float(std::span(bytes).subspan(at + 4, 4));
    // Written so that a NaN fails.
    if (!(slope >= static_cast<float>(smallest_slope) && slope <= static_cast<float>(largest_slope)))
      problems.push_back({.path = "/eeprom/" + address_text(address + static_cast<unsigned>(at)),
                          .message = "is no slope of a converter",
                          .given = number_or_text(slope),
                          .allowed = {{"from", smallest_slope}, {"to", largest_slope}}});
    if (!(std::abs(offset) <= largest_offset))
      problems.push_back({.path = "/eeprom/" + address_text(address + static_cast<unsigned>(at) + 4),
                          .message = "is no offset of a converter",
                          .given = number_or_text(offset),
                          .allowed = {{"from", -largest_offset}, {"to", largest_offset}},
                          .unit = "codes"});
    pairs[i] = {slope, offset};
  }
  return problems;
}

}  // namespace

double Calibration::volts(InputRange range, double code) const {
  const auto& c = input.at(static_cast<std::size_t>(range));
  return (c.slope * code + c.offset - half_scale) * full_scale(range) / half_scale;
}

std::uint16_t Calibration::code(int output_channel, double volts) const {
  const auto& c = output.at(static_cast<std::size_t>(output_channel));
  const double safe = std::isnan(volts) ? 0 : volts;
  const double wanted = c.slope * (safe / output_full_scale * half_scale + half_scale) + c.offset;
  return static_cast<std::uint16_t>(std::clamp(std::floor(wanted + 0.5), 0.0, 65535.0));
}

double Calibration::output_volts(int output_channel, double code) const {
  const auto& c = output.at(static_cast<std::size_t>(output_channel));
  return ((code - c.offset) / c.slope - half_scale) / half_scale * output_full_scale;
}

VoltRange Calibration::output_reach(int output_channel) const {
  // As with any converter of two's complement the full scale itself is one code short.
  constexpr double codes = 2 * half_scale;
  return {.low = std::max(-output_full_scale, output_volts(output_channel, 0)),
          .high = std::min(output_full_scale, output_volts(output_channel, codes))};
}

Calibration read_calibration(Unit& unit) {
  Calibration out;
  auto problems = read_pairs(unit, input_address, out.input);
  if (unit.model().outputs > 0) {
    auto more = read_pairs(unit, output_address, out.output);
    problems.insert(problems.end(), more.begin(), more.end());
  }
  if (problems.empty()) return out;
  problems.back().hint = "have the unit calibrated, or restore its factory calibration";
  throw Error(ErrorCode::device_unavailable,
              "the calibration stored in unit " + unit.id().serial + " is not valid", std::move(problems));
}

nlohmann::json to_json(const Calibration& calibration) {
  const auto pairs = [](const auto& corrections) {
    auto out = nlohmann::json::array();
    for (const auto& c : corrections) out.push_back({{"slope", c.slope}, {"offset", c.offset}});
    return out;
  };
  return {{"input", pairs(calibration.input)}, {"output", pairs(calibration.output)}};
}

}  // namespace ferrobench::daq::usb
