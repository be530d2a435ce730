#include "daq/usb/amplifier.h"

#include <algorithm>
#include <cmath>

#include "daq/program_problems.h"

namespace ferrobench::daq::usb {

Amplifier::Amplifier(const AmplifierConfig& a, const SpecimenConfig& specimen, VoltRange unit)
    : volts_per_field_((a.polarity == Polarity::normal ? 1 : -1) * specimen.layer_thickness / a.gain) {
  const auto [low, high] = std::minmax({field(unit.low), field(unit.high)});
  range_ = {.min = std::max(a.voltage_min / specimen.layer_thickness, low),
            .max = std::min(a.voltage_max / specimen.layer_thickness, high)};
}

std::vector<Problem> check_amplifier(const protocols::SampledWaveform& program,
                                     const AmplifierConfig& amplifier, const SpecimenConfig& specimen,
                                     const OutputRange& range) {
  ProgramProblems out(program.waveform());
  const double slack = 1e-9 * (range.max - range.min);
  const double thickness = specimen.layer_thickness;
  const auto pieces = program.waveform().pieces();
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    const auto& piece = pieces[i];
    const double swing = piece.kind == protocols::PieceKind::sine ? std::abs(piece.amplitude) : 0;
    const bool sine = piece.kind == protocols::PieceKind::sine;
    const double low = sine ? piece.center - swing : std::min(piece.from, piece.to);
    const double high = sine ? piece.center + swing : std::max(piece.from, piece.to);
    // Written so that a NaN fails.
    if (!(low >= range.min - slack && high <= range.max + slack))
      out.add(i, std::max(high - range.max, range.min - low),
              {.path = "level",
               .message = "the amplifier does not reach the voltage",
               .given = (!(high <= range.max + slack) ? high : low) * thickness,
               .allowed = {{"from", range.min * thickness}, {"to", range.max * thickness}},
               .unit = "V",
               .hint = "lower the level, or use another amplifier"});
    const auto samples = program.corners()[i + 1] - program.corners()[i];
    const double stretch = piece.duration * program.rate() / static_cast<double>(samples);
    const double slew = piece.max_slew() * stretch * thickness;
    if (!(slew <= amplifier.slew_limit * (1 + 1e-9)))
      out.add(i, slew,
              {.path = "rate",
               .message = "the amplifier does not follow",
               .given = slew,
               .allowed = {{"to", amplifier.slew_limit}},
               .unit = "V/s",
               .hint = "make the segment slower"});
    const double current = slew * specimen.capacitance;
    if (!(current <= amplifier.current_limit * (1 + 1e-9)))
      out.add(i, current,
              {.path = "rate",
               .message = "the specimen needs more current than the amplifier gives",
               .given = current,
               .allowed = {{"to", amplifier.current_limit}},
               .unit = "A",
               .hint = "make the segment slower; the current is capacitance times dV/dt"});
  }
  return out.take();
}

}  // namespace ferrobench::daq::usb
