#include "daq/guard/check.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>

#include "daq/guard/reverse_time.h"
#include "daq/program_problems.h"

namespace ferrobench::daq {

namespace {

using protocols::Piece;
using protocols::PieceKind;

// How limits are set; no form of the page does.
constexpr const char* by_command = "by 'ferrobench limits set' on the command line, or limits.set";

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
      : program_(program),
        limits_(limits),
        unit_(program.waveform().unit()),
        slack_(1e-9 * (limits.field_max - limits.field_min)),
        out_(program.waveform()) {}

  std::vector<Problem> run() {
    const auto pieces = program_.waveform().pieces();
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      const auto samples = program_.corners()[i + 1] - program_.corners()[i];
      const double duration = static_cast<double>(samples) / program_.rate();
      field(i, extremes(pieces[i]));
      if (i > 0) jump(i, std::abs(pieces[i].from - pieces[i - 1].to));
      slew(i, pieces[i].max_slew() * pieces[i].duration / duration);
      reverse(i, reversed(pieces[i], duration));
      sampling(i, program_.recorded_rate(i), pieces[i].sampling);
    }
    return out_.take();
  }

 private:
  void field(std::size_t i, const Extremes& e) {
    // Written so that a NaN fails.
    if (!(e.high <= limits_.field_max + slack_) || !(e.low >= limits_.field_min - slack_)) {
      const bool high = !(e.high <= limits_.field_max + slack_);
      out_.add(
          i, high ? e.high - limits_.field_max : limits_.field_min - e.low,
          {.path = "level",
           .message = high ? "the field rises above the limit" : "the field falls below the limit",
           .given = unit_.level(high ? e.high : e.low),
           .allowed = {{"from", unit_.level(limits_.field_min)}, {"to", unit_.level(limits_.field_max)}},
           .unit = unit_.name,
           .hint = std::string("lower the level, or set limits that the specimen allows ") + by_command});
    }
  }

  void jump(std::size_t i, double step) {
    if (!(step <= slack_))
      out_.add(i, step,
               {.path = "start",
                .message = "the field jumps",
                .given = unit_.level(step),
                .allowed = 0,
                .unit = unit_.name,
                .hint = "join the levels by a ramp"});
  }

  void slew(std::size_t i, double given) {
    if (!(given <= limits_.slew * (1 + 1e-9)))
      out_.add(i, given,
               {.path = "rate",
                .message = "the field changes too fast",
                .given = unit_.level(given),
                .allowed = {{"to", unit_.level(limits_.slew)}},
                .unit = unit_.rate_name(),
                .hint = "lower the rate or the frequency, or sample fast enough to resolve the segment"});
  }

  void sampling(std::size_t i, double rate, double fewest) {
    if (!(rate >= fewest * (1 - 1e-9)))
      out_.add(i, fewest,
               {.path = "frequency",
                .message = "the sine is sampled too slowly to be evaluated",
                .given = rate,
                .allowed = {{"from", fewest}},
                .unit = "Hz",
                .hint = "raise sample_rate_Hz, or lower the frequency"});
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

  // One excursion is one problem, at the segment where it goes beyond the limit.
  void reverse(std::size_t i, double time) {
    const bool over = !(time <= limits_.reverse_field_time * (1 + 1e-9));
    if (over && !reported_)
      out_.add(i, time,
               {.path = "level",
                .message = "the field stays reversed for too long",
                .given = time,
                .allowed = {{"to", limits_.reverse_field_time}},
                .unit = "s",
                .hint = "shorten the holds below " + in_words(limits_.reverse_field_threshold) +
                        ", or raise reverse_field_time " + by_command});
    reported_ = over;
  }

  std::string in_words(double field) const {
    std::ostringstream text;
    text << unit_.level(field) << ' ' << unit_.name;
    return text.str();
  }

  const protocols::SampledWaveform& program_;
  const Limits& limits_;
  const protocols::LevelUnit& unit_;
  double slack_;
  ReverseTimer reverse_;
  bool reported_ = false;
  ProgramProblems out_;
};

}  // namespace

std::vector<Problem> check(const protocols::SampledWaveform& program, const Limits& limits) {
  return Checker(program, limits).run();
}

}  // namespace ferrobench::daq
