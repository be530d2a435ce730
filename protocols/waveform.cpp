#include "protocols/waveform.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <utility>

namespace ferrobench::protocols {
namespace {

constexpr double two_pi = 2 * std::numbers::pi;

double sample_at(std::span<const double> levels, double fraction) {
  const double at = fraction * static_cast<double>(levels.size() - 1);
  const double whole = std::round(at);
  // On the grid the samples come back as they are, whatever the rounding.
  if (std::abs(at - whole) <= 1e-15 * static_cast<double>(levels.size()) + 1e-9)
    return levels[static_cast<std::size_t>(whole)];
  const auto below = static_cast<std::size_t>(at);
  return levels[below] + (levels[below + 1] - levels[below]) * (at - static_cast<double>(below));
}

double value_at(const Piece& piece, double fraction) {
  if (piece.kind == PieceKind::samples) return sample_at(*piece.levels, fraction);
  if (piece.kind != PieceKind::sine) return piece.from + (piece.to - piece.from) * fraction;
  if (fraction == 0) return piece.from;
  return piece.center +
         piece.amplitude * std::sin(two_pi * piece.frequency * piece.duration * fraction + piece.phase);
}

// Whether `first + period * k` lies in [from, to] for some whole k.
bool passes(double from, double to, double first, double period) {
  return first + period * std::ceil((from - first) / period) <= to;
}

std::pair<double, double> extremes(const Piece& piece) {
  double low = std::min(piece.from, piece.to);
  double high = std::max(piece.from, piece.to);
  if (piece.kind == PieceKind::samples) {
    const auto [lowest, highest] = std::minmax_element(piece.levels->begin(), piece.levels->end());
    return {*lowest, *highest};
  }
  if (piece.kind == PieceKind::sine) {
    const double end = piece.phase + two_pi * piece.frequency * piece.duration;
    const double size = std::abs(piece.amplitude);
    const double crest = std::copysign(std::numbers::pi / 2, piece.amplitude);
    if (passes(piece.phase, end, crest, two_pi)) high = std::max(high, piece.center + size);
    if (passes(piece.phase, end, -crest, two_pi)) low = std::min(low, piece.center - size);
  }
  return {low, high};
}

}  // namespace

double Piece::value(double time_from_start_of_program) const {
  const double passed = time_from_start_of_program - start;
  if (passed <= 0) return from;
  return passed >= duration ? to : value_at(*this, passed / duration);
}

double Piece::max_slew() const {
  if (kind == PieceKind::samples) {
    double step = 0;
    for (std::size_t i = 1; i < levels->size(); ++i)
      step = std::max(step, std::abs((*levels)[i] - (*levels)[i - 1]));
    return step * static_cast<double>(levels->size() - 1) / duration;
  }
  if (kind != PieceKind::sine) return std::abs(to - from) / duration;
  const double end = phase + two_pi * frequency * duration;
  const double steepest = passes(phase, end, 0, std::numbers::pi)
                              ? 1
                              : std::max(std::abs(std::cos(phase)), std::abs(std::cos(end)));
  return two_pi * frequency * std::abs(amplitude) * steepest;
}

Waveform::Waveform(std::vector<Piece> pieces, std::vector<Segment> segments, LevelUnit unit,
                   std::optional<AveragedRepeat> averaged)
    : pieces_(std::move(pieces)),
      segments_(std::move(segments)),
      unit_(std::move(unit)),
      averaged_(std::move(averaged)) {
  if (pieces_.size() != segments_.size())
    throw std::invalid_argument("a waveform needs one segment row for each piece");
  double end = 0;
  for (const auto& piece : pieces_) {
    if (!(piece.duration > 0) || !std::isfinite(piece.duration) || !std::isfinite(piece.from) ||
        !std::isfinite(piece.to))
      throw std::invalid_argument("a piece needs a positive duration and finite levels");
    const bool sampled = piece.kind == PieceKind::samples;
    if (sampled && (!piece.levels || piece.levels->size() < 2 ||
                    !std::ranges::all_of(*piece.levels, [](double v) { return std::isfinite(v); }) ||
                    piece.from != piece.levels->front() || piece.to != piece.levels->back()))
      throw std::invalid_argument("a piece of samples needs two or more finite levels");
    if (!(std::abs(piece.start - end) <= 1e-9 * std::max(1.0, end)))
      throw std::invalid_argument("pieces must follow each other without a gap, from time 0");
    end = piece.start + piece.duration;
  }
}

std::string Waveform::place(std::size_t piece) const {
  const auto& path = segments_.at(piece).path;
  return path.empty() ? "/segments/" + std::to_string(piece) : path;
}

double Waveform::duration() const {
  return pieces_.empty() ? 0 : pieces_.back().start + pieces_.back().duration;
}

double Waveform::value(double time) const {
  if (pieces_.empty()) return 0;
  const auto next = std::upper_bound(pieces_.begin(), pieces_.end(), time,
                                     [](double t, const Piece& piece) { return t < piece.start; });
  return next == pieces_.begin() ? pieces_.front().from : std::prev(next)->value(time);
}

double Waveform::minimum() const {
  double low = pieces_.empty() ? 0 : pieces_.front().from;
  for (const auto& piece : pieces_) low = std::min(low, extremes(piece).first);
  return low;
}

double Waveform::maximum() const {
  double high = pieces_.empty() ? 0 : pieces_.front().from;
  for (const auto& piece : pieces_) high = std::max(high, extremes(piece).second);
  return high;
}

double Waveform::max_slew() const {
  double slew = 0;
  for (std::size_t i = 0; i < pieces_.size(); ++i) {
    slew = std::max(slew, pieces_[i].max_slew());
    if (i > 0 && pieces_[i].from != pieces_[i - 1].to) slew = std::numeric_limits<double>::infinity();
  }
  return slew;
}

double Waveform::sampling() const {
  double most = 0;
  for (const auto& piece : pieces_) most = std::max(most, piece.sampling);
  return most;
}

double Waveform::fastest_recorded() const {
  double most = 0;
  for (const auto& piece : pieces_) most = std::max(most, piece.recorded.rate);
  return most;
}

SampledWaveform::SampledWaveform(Waveform waveform, double rate, double recorded)
    : waveform_(std::move(waveform)), rate_(rate), recorded_(recorded) {
  if (!(rate > 0) || !std::isfinite(rate)) throw std::invalid_argument("a sample rate must be above zero");
  // Beyond 2^53 neighbouring sample numbers are no longer distinct as doubles.
  if (waveform_.duration() * rate > 9e15) throw std::invalid_argument("a program has at most 9e15 samples");
  corners_.reserve(waveform_.pieces().size() + 1);
  corners_.push_back(0);
  for (const auto& piece : waveform_.pieces()) {
    const double end = piece.start + piece.duration;
    const auto samples =
        std::max(static_cast<std::uint64_t>(std::llround(end * rate)), corners_.back() + 1) - corners_.back();
    corners_.push_back(corners_.back() + samples);
    distortion_ = std::max(distortion_, std::abs(static_cast<double>(corners_.back()) / rate - end));
    max_slew_ =
        std::max(max_slew_, piece.max_slew() * (piece.duration * rate / static_cast<double>(samples)));
  }
}

std::uint64_t SampledWaveform::size() const {
  return corners_.empty() ? 0 : corners_.back() + 1;
}

RecordedRows SampledWaveform::recorded_rows(std::size_t piece) const {
  auto asked = waveform_.pieces()[piece].recorded;
  if (asked.rate == 0) asked.rate = recorded_;
  return {asked, rate_};
}

double SampledWaveform::recorded_rate(std::size_t piece) const {
  return rate_ / static_cast<double>(recorded_rows(piece).stride());
}

std::uint64_t SampledWaveform::recorded_size() const {
  std::uint64_t rows = size() > 0 ? 1 : 0;
  for (std::size_t i = 0; i + 1 < corners_.size(); ++i)
    rows += recorded_rows(i).count(corners_[i + 1] - corners_[i]);
  return rows;
}

double SampledWaveform::value(std::uint64_t sample) const {
  double out = 0;
  fill(sample, {&out, 1});
  return out;
}

void SampledWaveform::fill(std::uint64_t first, std::span<double> out) const {
  const auto pieces = waveform_.pieces();
  const auto next = std::upper_bound(corners_.begin(), corners_.end(), first);
  auto index = next == corners_.begin() ? 0 : static_cast<std::size_t>(next - corners_.begin()) - 1;
  std::size_t written = 0;
  for (; written < out.size() && index < pieces.size(); ++index) {
    const auto begin = corners_[index];
    const auto samples = static_cast<double>(corners_[index + 1] - begin);
    const auto count = std::min<std::uint64_t>(out.size() - written, corners_[index + 1] - (first + written));
    const auto offset = first + written - begin;
    const auto& levels = pieces[index].levels;
    if (levels && levels->size() == corners_[index + 1] - begin + 1) {
      std::copy_n(levels->begin() + static_cast<std::ptrdiff_t>(offset), count,
                  out.begin() + static_cast<std::ptrdiff_t>(written));
      written += count;
      continue;
    }
    for (std::uint64_t i = 0; i < count; ++i)
      out[written + i] = value_at(pieces[index], static_cast<double>(offset + i) / samples);
    written += count;
  }
  const double last = pieces.empty() ? 0 : pieces.back().to;
  std::fill(out.begin() + static_cast<std::ptrdiff_t>(written), out.end(), last);
}

}  // namespace ferrobench::protocols
