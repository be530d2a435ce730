#include "daq/usb/amplifier.h"

#include <algorithm>
#include <cmath>

#include "daq/usb/calibration.h"

namespace ferrobench::daq::usb {

Amplifier::Amplifier(const AmplifierConfig& a, const SpecimenConfig& specimen)
    : volts_per_field_((a.polarity == Polarity::normal ? 1 : -1) * specimen.layer_thickness / a.gain) {
  const double reach = output_full_scale * a.gain;  // V, of the unit through the amplifier
  range_ = {.min = std::max(a.voltage_min, -reach) / specimen.layer_thickness,
            .max = std::min(a.voltage_max, reach) / specimen.layer_thickness};
}

std::vector<Problem> check_amplifier(const protocols::SampledWaveform& program,
                                     const AmplifierConfig& amplifier, const SpecimenConfig& specimen) {
  std::vector<Problem> out;
  const auto range = Amplifier(amplifier, specimen).range();
  const double slack = 1e-9 * (range.max - range.min);
  const double thickness = specimen.layer_thickness;
  const auto pieces = program.waveform().pieces();
  const auto segments = program.waveform().segments();
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    const auto& piece = pieces[i];
    const auto path = "/segments/" + std::to_string(i) + "/";
    const auto place = i < segments.size() ? " in \"" + segments[i].label + "\"" : std::string{};
    const double swing = piece.kind == protocols::PieceKind::sine ? std::abs(piece.amplitude) : 0;
    const bool sine = piece.kind == protocols::PieceKind::sine;
    const double low = sine ? piece.center - swing : std::min(piece.from, piece.to);
    const double high = sine ? piece.center + swing : std::max(piece.from, piece.to);
    // Written so that a NaN fails.
    if (!(low >= range.min - slack && high <= range.max + slack))
      out.push_back({.path = path + "level",
                     .message = "the amplifier does not reach the voltage" + place,
                     .given = (!(high <= range.max + slack) ? high : low) * thickness,
                     .allowed = {{"from", range.min * thickness}, {"to", range.max * thickness}},
                     .unit = "V",
                     .hint = "lower the level, or use another amplifier"});
    const auto samples = program.corners()[i + 1] - program.corners()[i];
    const double stretch = piece.duration * program.rate() / static_cast<double>(samples);
    const double slew = piece.max_slew() * stretch * thickness;
    if (!(slew <= amplifier.slew_limit * (1 + 1e-9)))
      out.push_back({.path = path + "rate",
                     .message = "the amplifier does not follow" + place,
                     .given = slew,
                     .allowed = amplifier.slew_limit,
                     .unit = "V/s",
                     .hint = "make the segment slower"});
    const double current = slew * specimen.capacitance;
    if (!(current <= amplifier.current_limit * (1 + 1e-9)))
      out.push_back({.path = path + "rate",
                     .message = "the specimen needs more current than the amplifier gives" + place,
                     .given = current,
                     .allowed = amplifier.current_limit,
                     .unit = "A",
                     .hint = "make the segment slower; the current is capacitance times dV/dt"});
  }
  return out;
}

}  // namespace ferrobench::daq::usb
