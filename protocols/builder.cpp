#include "protocols/builder.h"

#include <cmath>
#include <numbers>

#include "base/error.h"
#include "protocols/segments.h"

namespace ferrobench::protocols {
namespace {

[[noreturn]] void refuse(Problem problem) {
  throw Error(ErrorCode::bad_protocol, "the program cannot be played", std::move(problem));
}

}  // namespace

void Builder::enter(const std::string& path, std::string prefix) {
  path_ = path;
  prefix_ = std::move(prefix);
  step();
}

void Builder::average(const std::string& path) {
  if (averaged_)
    refuse({.path = path + "/average",
            .message = "is of a second repeat",
            .given = true,
            .allowed = averaged_->path,
            .hint = "a recording has one mean"});
  averaged_ = {.path = path, .begin = {}};
}

// Counts work and not only pieces, so that a repeat of nothing ends too.
void Builder::step() {
  if (++steps_ > max_pieces)
    refuse({.path = path_,
            .message = "makes the program too long",
            .given = "more than " + std::to_string(max_pieces) + " steps",
            .allowed = max_pieces,
            .unit = "steps",
            .hint = "fewer repeats, cycles or points"});
}

bool Builder::moves_to(double to) const {
  return std::abs(to - level_) > same_level;
}

std::string Builder::direction(double to) const {
  return to > level_ ? " up" : " down";
}

void Builder::add(Piece piece, double rate, std::string_view label) {
  step();
  if (!(rate <= rate_info("").max))
    refuse({.path = path_,
            .message = "is too steep",
            .given = rate,
            .allowed = {{"to", rate_info("").max}},
            .unit = unit_.rate_name()});
  if (!(time_ + piece.duration <= max_duration))
    refuse({.path = path_,
            .message = "makes the program last too long",
            .given = time_ + piece.duration,
            .allowed = max_duration,
            .unit = "s"});
  piece.start = time_;
  time_ += piece.duration;
  level_ = piece.to;
  piece.from = unit_.field(piece.from);
  piece.to = unit_.field(piece.to);
  piece.center = unit_.field(piece.center);
  piece.amplitude = unit_.field(piece.amplitude);
  segments_.push_back({.kind = piece.kind == PieceKind::hold ? "hold" : "ramp",
                       .label = prefix_ + std::string(label),
                       .start = piece.start,
                       .end = time_,
                       .level = piece.to,
                       .rate = unit_.field(rate),
                       .path = path_});
  piece.recorded = recorded_;
  if (piece.kind != PieceKind::hold) piece.recorded.per_decade = 0;
  pieces_.push_back(piece);
}

void Builder::ramp_to(double to, double rate, std::string_view label) {
  if (!moves_to(to)) return;
  if (!(rate > 0))
    refuse({.path = path_,
            .message = "starts at another level than the program is at, and has no slope to go there by",
            .given = to,
            .allowed = level_,
            .unit = unit_.name,
            .hint = "put a ramp before it"});
  const double time = std::abs(to - level_) / rate;
  add({.kind = PieceKind::ramp, .duration = time, .from = level_, .to = to}, rate, label);
}

void Builder::ramp_in(double to, double time, std::string_view label) {
  if (!moves_to(to)) return;
  add({.kind = PieceKind::ramp, .duration = time, .from = level_, .to = to}, std::abs(to - level_) / time,
      label);
}

void Builder::hold(double time, std::string_view label) {
  if (time > 0) add({.kind = PieceKind::hold, .duration = time, .from = level_, .to = level_}, 0, label);
}

void Builder::sine(double center, double amplitude, double frequency, double cycles, double phase,
                   std::string_view label, double samples) {
  Piece piece{.kind = PieceKind::sine,
              .duration = cycles / frequency,
              .from = level_,
              .to = center + amplitude * std::sin(2 * std::numbers::pi * std::fmod(cycles, 1.0) + phase),
              .center = center,
              .amplitude = amplitude,
              .frequency = frequency,
              .phase = phase,
              .sampling = samples * frequency};
  add(piece, piece.max_slew(), label);
}

}  // namespace ferrobench::protocols
