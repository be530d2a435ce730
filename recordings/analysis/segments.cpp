// Finds the corners of a piecewise-linear field program from its samples: split where a chord misses the
// samples by more than the noise explains, fit a line to every run, join runs that one line serves, and put
// each corner where its two lines miss least and meet.
#include "recordings/analysis/segments.h"

#include <cmath>

#include "recordings/analysis/statistics.h"

namespace ferrobench::recordings {
namespace {

struct Samples {
  std::vector<double> time, value;
  std::vector<std::size_t> index;  // in the recording: samples of a gap are left out
};

Samples known_samples(const Recording& r) {
  const auto& values = r.at(r.has(Channel::command) ? Channel::command : Channel::field);
  Samples out;
  for (std::size_t i = 0; i < r.size(); ++i) {
    if (std::isnan(values[i])) continue;
    out.time.push_back(r.time[i]);
    out.value.push_back(values[i]);
    out.index.push_back(i);
  }
  return out;
}

// First and last sample of a run, both included.
struct Run {
  std::size_t first, last;
  Line line;
};

Run fit(const Samples& s, std::size_t first, std::size_t last) {
  const auto count = last - first + 1;
  return {first, last,
          fit_line(std::span(s.time).subspan(first, count), std::span(s.value).subspan(first, count))};
}

double worst_miss(const Samples& s, const Run& run) {
  double worst = 0;
  for (std::size_t i = run.first; i <= run.last; ++i)
    worst = std::max(worst, std::abs(s.value[i] - run.line.at(s.time[i])));
  return worst;
}

// The chord of a stretch of samples. Squares are summed of what lies beside it: it is of the size that
// counts, and so is its rounding.
struct Chord {
  Chord(const Samples& samples, std::size_t first, std::size_t last)
      : s(samples),
        time(s.time[first]),
        value(s.value[first]),
        slope((s.value[last] - value) / (s.time[last] - time)) {}
  double beside(std::size_t i) const { return s.value[i] - value - slope * (s.time[i] - time); }

  const Samples& s;
  double time, value, slope;
};

// A comb splits at its ends again and again; from a depth that others do not reach on, the middle is taken,
// so that the time stays bounded. What that splits in vain is joined again.
std::vector<std::size_t> split(const Samples& s, double tolerance) {
  struct Piece {
    std::size_t first, last;
    int depth;
  };
  constexpr int deep = 60;
  std::vector<std::size_t> corners{0, s.time.size() - 1};
  std::vector<Piece> open{{0, s.time.size() - 1, 0}};
  while (!open.empty()) {
    const auto [first, last, depth] = open.back();
    open.pop_back();
    const Chord chord(s, first, last);
    double worst = tolerance;
    std::size_t corner = first;
    for (std::size_t i = first + 1; i < last; ++i) {
      const double miss = std::abs(chord.beside(i));
      if (miss > worst) {
        worst = miss;
        corner = i;
      }
    }
    if (corner == first) continue;
    if (depth > deep) corner = first + (last - first) / 2;
    corners.push_back(corner);
    open.push_back({first, corner, depth + 1});
    open.push_back({corner, last, depth + 1});
  }
  std::ranges::sort(corners);
  return corners;
}

std::vector<Run> join(const Samples& s, const std::vector<std::size_t>& corners, double tolerance) {
  std::vector<Run> runs;
  for (std::size_t i = 1; i < corners.size(); ++i) {
    runs.push_back(fit(s, corners[i - 1], corners[i]));
    while (runs.size() > 1) {
      const auto both = fit(s, runs[runs.size() - 2].first, runs.back().last);
      if (worst_miss(s, both) > tolerance) break;
      runs.pop_back();
      runs.back() = both;
    }
  }
  return runs;
}

double meeting_time(const Run& before, const Run& after) {
  return (after.line.at(0) - before.line.at(0)) / (before.line.slope - after.line.slope);
}

// A single step between two runs that meet within it is a corner that fell between two samples.
void drop_corner_steps(const Samples& s, std::vector<Run>& runs) {
  std::vector<Run> kept;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (i > 0 && i + 1 < runs.size() && runs[i].last == runs[i].first + 1) {
      const double meeting = meeting_time(kept.back(), runs[i + 1]);
      const double slack = 1e-6 * (s.time[runs[i].last] - s.time[runs[i].first]);
      if (meeting >= s.time[runs[i].first] - slack && meeting <= s.time[runs[i].last] + slack) continue;
    }
    kept.push_back(runs[i]);
  }
  runs = std::move(kept);
}

// The sample nearest to where two neighbouring lines meet, between the middles of their runs.
std::size_t meeting_sample(const Samples& s, const Run& before, const Run& after) {
  const double meeting = meeting_time(before, after);
  const auto low = s.time.begin() + static_cast<std::ptrdiff_t>((before.first + before.last) / 2 + 1);
  const auto high = s.time.begin() + static_cast<std::ptrdiff_t>((after.first + after.last) / 2);
  if (low >= high || !std::isfinite(meeting)) return before.last;
  auto found = std::lower_bound(low, high, meeting);
  if (found != low && meeting - *(found - 1) < *found - meeting) --found;
  return static_cast<std::size_t>(found - s.time.begin());
}

// Sums over the samples of a run that grows by one at a time.
class Growing {
 public:
  explicit Growing(double time) : origin_(time) {}
  void add(double time, double v) {
    const double t = time - origin_;
    count_ += 1;
    t_ += t;
    v_ += v;
    tt_ += t * t;
    tv_ += t * v;
    vv_ += v * v;
  }
  // What the best line misses.
  double squares() const {
    const double tt = tt_ - t_ * t_ / count_, tv = tv_ - t_ * v_ / count_, vv = vv_ - v_ * v_ / count_;
    return std::max(0.0, tt > 0 ? vv - tv * tv / tt : vv);
  }

 private:
  double origin_, count_ = 0, t_ = 0, v_ = 0, tt_ = 0, tv_ = 0, vv_ = 0;
};

struct Corner {
  std::size_t at = 0;
  double squares = 0, without = 0;  // missed by the best two lines, by one
};

Corner best_corner(const Samples& s, std::size_t first, std::size_t last) {
  const Chord chord(s, first, last);
  Growing left(s.time[first]), right(s.time[last]);
  std::vector<double> after(last - first + 1);
  for (std::size_t i = last + 1; i-- > first;) {
    right.add(s.time[i], chord.beside(i));
    after[i - first] = right.squares();
  }
  Corner out{first + 1, std::numeric_limits<double>::infinity(), after[0]};
  left.add(s.time[first], chord.beside(first));
  for (std::size_t i = first + 1; i < last; ++i) {
    left.add(s.time[i], chord.beside(i));
    const double squares = left.squares() + after[i - first];
    if (squares < out.squares) out = {i, squares, out.without};
  }
  return out;
}

double squares(const Samples& s, const Run& run) {
  const Chord chord(s, run.first, run.last);
  Growing sums(s.time[run.first]);
  for (std::size_t i = run.first; i <= run.last; ++i) sums.add(s.time[i], chord.beside(i));
  return sums.squares();
}

// Moves each corner to where its two lines together miss least. Runs that noise alone may have made are
// dropped: what the best corner takes off a straight line's squares then is below 30 of the noise's.
void settle(const Samples& s, double noise, std::vector<Run>& runs) {
  constexpr int sweeps = 10;
  const double chance = 30 * noise * noise;
  bool moved = true;
  for (int sweep = 0; sweep < sweeps && moved; ++sweep) {
    moved = false;
    std::vector<Run> kept{runs.front()};
    for (std::size_t i = 1; i < runs.size(); ++i) {
      const auto before = kept.back();
      auto corner = best_corner(s, before.first, runs[i].last);
      if (corner.without - corner.squares < chance) {
        kept.back() = fit(s, before.first, runs[i].last);
        continue;
      }
      if (i + 1 < runs.size()) {
        const auto one = best_corner(s, before.first, runs[i + 1].last);
        if (one.squares - squares(s, before) - squares(s, runs[i]) - squares(s, runs[i + 1]) < chance) {
          corner = one;
          ++i;
        }
      }
      moved = moved || corner.at != runs[i].first;
      kept.back() = fit(s, before.first, corner.at);
      kept.push_back(fit(s, corner.at, runs[i].last));
    }
    moved = moved || kept.size() != runs.size();
    runs = std::move(kept);
  }
}

bool is_hold(const Samples& s, const Run& run, double noise, double range) {
  const double change = run.line.slope * (s.time[run.last] - s.time[run.first]);
  return std::abs(change) <= std::max(3 * noise, 1e-6 * range);
}

std::vector<Run> cut_at_bends(const Samples& s, const std::vector<Run>& runs, double noise, double range,
                              double bend) {
  constexpr std::size_t fewest = 3;  // intervals of a part
  std::vector<Run> out;
  for (const auto& run : runs) {
    out.push_back(run);
    if (run.last < run.first + 2 * fewest || is_hold(s, run, noise, range)) continue;
    const auto corner = best_corner(s, run.first, run.last);
    if (corner.without - corner.squares <= bend * noise * noise) continue;
    const auto at = std::clamp(corner.at, run.first + fewest, run.last - fewest);
    out.back() = fit(s, run.first, at);
    out.push_back(fit(s, at, run.last));
  }
  return out;
}

}  // namespace

std::vector<SegmentRow> infer_segments(const Recording& recording, double bend) {
  if (!recording.has(Channel::command) && !recording.has(Channel::field)) return {};
  const auto s = known_samples(recording);
  if (s.time.size() < 2) return {};
  const auto [low, high] = std::ranges::minmax(s.value);
  const double noise = estimate_noise(s.value);
  // Six standard deviations: one false corner in a hundred million samples.
  const double tolerance = std::max(6 * noise, 1e-6 * (high - low)) + std::numeric_limits<double>::min();
  auto runs = join(s, split(s, tolerance), tolerance);
  drop_corner_steps(s, runs);
  if (6 * noise >= tolerance) settle(s, noise, runs);
  for (std::size_t i = 1; i < runs.size(); ++i) {
    const auto corner = meeting_sample(s, runs[i - 1], runs[i]);
    runs[i - 1] = fit(s, runs[i - 1].first, corner);
    runs[i] = fit(s, corner, runs[i].last);
  }
  if (std::isfinite(bend)) runs = cut_at_bends(s, runs, noise, high - low, bend);
  std::vector<SegmentRow> out;
  int ramps = 0, holds = 0;
  for (const auto& run : runs) {
    const bool hold = is_hold(s, run, noise, high - low);
    out.push_back({.start_sample = static_cast<std::int64_t>(s.index[run.first]),
                   .end_sample = static_cast<std::int64_t>(s.index[run.last]),
                   .kind = hold ? "hold" : "ramp",
                   .label = hold ? "hold " + std::to_string(++holds) : "ramp " + std::to_string(++ramps),
                   .level = run.line.at(s.time[run.last]),
                   .rate = hold ? 0 : std::abs(run.line.slope)});
  }
  return out;
}

std::vector<SegmentRow> segments_of(const Recording& recording) {
  return recording.segments.empty() ? infer_segments(recording) : recording.segments;
}

}  // namespace ferrobench::recordings
