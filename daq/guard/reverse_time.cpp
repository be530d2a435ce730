#include "daq/guard/reverse_time.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace ferrobench::daq {

namespace {

constexpr double turn = 2 * std::numbers::pi;

TimeBelow always(double duration) {
  return {.at_start = duration, .longest = duration, .at_end = duration, .whole = true};
}

// sin(theta) < q from theta = first to last, in radians.
TimeBelow sine_below(double q, double first, double last) {
  if (q <= -1) return {};
  if (q > 1) return always(last - first);
  // Excursions run from half a turn - asin(q) to a turn + asin(q), and again every turn.
  const double begin = turn / 2 - std::asin(q);
  const double end = turn + std::asin(q);
  const double k_first = std::floor((first - end) / turn) + 1;
  const double k_last = std::ceil((last - begin) / turn) - 1;
  if (k_last < k_first) return {};

  const auto length = [&](double k) {
    return std::min(end + k * turn, last) - std::max(begin + k * turn, first);
  };
  TimeBelow out;
  const bool open_start = begin + k_first * turn < first;
  const bool open_end = end + k_last * turn > last;
  if (open_start && open_end && k_first == k_last) return always(last - first);
  if (open_start) out.at_start = length(k_first);
  if (open_end) out.at_end = length(k_last);
  // Only the first and the last excursion can be cut short, so one in between stands for all.
  out.longest = std::max(length(k_first), length(k_last));
  if (k_last - k_first >= 2) out.longest = std::max(out.longest, end - begin);
  return out;
}

}  // namespace

TimeBelow linear_time_below(double from, double to, double duration, double threshold) {
  const bool starts = from < threshold;
  const bool ends = to < threshold;
  if (starts && ends) return always(duration);
  if (!starts && !ends) return {};
  const double time = duration * (starts ? (threshold - from) / (to - from) : (threshold - to) / (from - to));
  return {.at_start = starts ? time : 0, .longest = time, .at_end = ends ? time : 0};
}

TimeBelow time_below(const protocols::Piece& piece, double duration, double threshold) {
  if (piece.kind != protocols::PieceKind::sine)
    return linear_time_below(piece.from, piece.to, duration, threshold);
  if (piece.amplitude == 0 || piece.frequency == 0)
    return piece.from < threshold ? always(duration) : TimeBelow{};
  const double shift = piece.amplitude < 0 ? turn / 2 : 0;
  const double first = std::remainder(piece.phase + shift, turn);
  const double sweep = turn * std::abs(piece.frequency) * piece.duration;
  const double q = (threshold - piece.center) / std::abs(piece.amplitude);
  TimeBelow out = sine_below(q, first, first + sweep);
  const double seconds = duration / sweep;
  out.at_start *= seconds;
  out.longest *= seconds;
  out.at_end *= seconds;
  return out;
}

double ReverseTimer::add(const TimeBelow& below) {
  const double joined = running_ + below.at_start;
  running_ = below.whole ? joined : below.at_end;
  return std::max({joined, below.longest, running_});
}

}  // namespace ferrobench::daq
