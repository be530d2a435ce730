#include "daq/guard/check.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "daq/guard/reverse_time.h"

namespace ferrobench::daq {

namespace {

using protocols::Piece;
using protocols::PieceKind;

struct Extremes {
  double low = 0;
  double high = 0;
};

Extremes extremes(const Piece& piece) {
  if (piece.kind == PieceKind::samples) {
    const auto [low, high] = std::ranges::minmax(*piece.levels);
    return {.low = low, .high = high};
  }
  Extremes out{.low = std::min(piece.from, piece.to), .high = std::max(piece.from, piece.to)};
  if (piece.kind != PieceKind::sine) return out;
  // A crest counts if the phase, in turns from the first crest, passes a whole number.
  const auto reaches = [&piece](double crest) {
    const double first = piece.phase / (2 * std::numbers::pi) - crest;
    const double last = first + piece.frequency * piece.duration;
    return std::floor(std::max(first, last)) >= std::ceil(std::min(first, last));
  };
  const double size = std::abs(piece.amplitude);
  const bool upright = piece.amplitude >= 0;
  if (reaches(upright ? 0.25 : 0.75)) out.high = std::max(out.high, piece.center + size);
  if (reaches(upright ? 0.75 : 0.25)) out.low = std::min(out.low, piece.center - size);
  return out;
}

class Checker {
 public:
  Checker(const protocols::SampledWaveform& program, const Limits& limits)
      : program_(program), limits_(limits), slack_(1e-9 * (limits.field_max - limits.field_min)) {}

  std::vector<Problem> run() {
    const auto pieces = program_.waveform().pieces();
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      const auto samples = program_.corners()[i + 1] - program_.corners()[i];
      const double duration = static_cast<double>(samples) / program_.rate();
      field(i, extremes(pieces[i]));
      if (i > 0) jump(i, std::abs(pieces[i].from - pieces[i - 1].to));
      slew(i, pieces[i].max_slew() * pieces[i].duration / duration);
      reverse(i, reversed(pieces[i], duration));
    }
    return std::move(out_);
  }

 private:
  void report(std::size_t i, const char* what, std::string message, const nlohmann::json& given,
              const nlohmann::json& allowed, const char* unit, std::string hint) {
    const auto segments = program_.waveform().segments();
    const auto label = i < segments.size() ? " in \"" + segments[i].label + "\"" : std::string{};
    out_.push_back({.path = "/segments/" + std::to_string(i) + "/" + what,
                    .message = std::move(message) + label,
                    .given = given,
                    .allowed = allowed,
                    .unit = unit,
                    .hint = std::move(hint)});
  }

  void field(std::size_t i, const Extremes& e) {
    // Written so that a NaN fails.
    if (!(e.high <= limits_.field_max + slack_) || !(e.low >= limits_.field_min - slack_)) {
      const bool high = !(e.high <= limits_.field_max + slack_);
      report(i, "level", high ? "the field rises above the limit" : "the field falls below the limit",
             high ? e.high : e.low, {{"from", limits_.field_min}, {"to", limits_.field_max}}, "V/m",
             "lower the level, or set limits that the specimen allows");
    }
  }

  void jump(std::size_t i, double step) {
    if (!(step <= slack_)) report(i, "start", "the field jumps", step, 0, "V/m", "join the levels by a ramp");
  }

  void slew(std::size_t i, double given) {
    if (!(given <= limits_.slew * (1 + 1e-9)))
      report(i, "rate", "the field changes too fast", given, limits_.slew, "V/m/s",
             "lower the rate or the frequency, or sample fast enough to resolve the segment");
  }

  double reversed(const Piece& piece, double duration) {
    const double threshold = limits_.reverse_field_threshold;
    if (piece.kind != PieceKind::samples) return reverse_.add(time_below(piece, duration, threshold));
    const auto& levels = *piece.levels;
    const double step = duration / static_cast<double>(levels.size() - 1);
    double longest = 0;
    for (std::size_t i = 1; i < levels.size(); ++i)
      longest = std::max(longest, reverse_.add(linear_time_below(levels[i - 1], levels[i], step, threshold)));
    return longest;
  }

  // One excursion is one problem, at the segment where it passes the limit.
  void reverse(std::size_t i, double time) {
    const bool over = !(time <= limits_.reverse_field_time * (1 + 1e-9));
    if (over && !reported_)
      report(i, "level", "the field stays reversed for too long", time, limits_.reverse_field_time, "s",
             "shorten the holds below " + nlohmann::json(limits_.reverse_field_threshold).dump() +
                 " V/m, or raise reverse_field_time");
    reported_ = over;
  }

  const protocols::SampledWaveform& program_;
  const Limits& limits_;
  double slack_;
  ReverseTimer reverse_;
  bool reported_ = false;
  std::vector<Problem> out_;
};

}  // namespace

std::vector<Problem> check(const protocols::SampledWaveform& program, const Limits& limits) {
  return Checker(program, limits).run();
}

}  // namespace ferrobench::daq
