#include "recordings/analysis/loops.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::recordings {

double loop_integral(std::span<const double> x, std::span<const double> y) {
  double sum = 0;
  std::size_t first = x.size(), before = 0;
  const auto add = [&](std::size_t a, std::size_t b) { sum += 0.5 * (x[a] + x[b]) * (y[b] - y[a]); };
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (std::isnan(x[i]) || std::isnan(y[i])) continue;
    if (first == x.size()) {
      first = i;
    } else {
      add(before, i);
    }
    before = i;
  }
  if (first < x.size()) add(before, first);
  return sum;
}

namespace {

// A branch as a function of x, walked through from its low end: where x does not get on, the last y counts.
class Branch {
 public:
  Branch(std::span<const double> x, std::span<const double> y, bool backwards, double sign)
      : x_(x), y_(y), backwards_(backwards), sign_(sign) {
    for (std::size_t i = 0; i < x_.size(); ++i)
      if (const auto p = sample(i); known(p)) end_ = std::max(end_, p.x);
    before_ = after_ = next();
    start_ = before_.x;
  }
  double start() const { return start_; }
  double end() const { return end_; }
  // x from start to end, rising from call to call.
  double at(double x) {
    while (after_.x <= x && after_.x < end_) {
      before_ = after_;
      after_ = next();
    }
    if (after_.x <= x) return after_.y;
    return before_.y + (after_.y - before_.y) * (x - before_.x) / (after_.x - before_.x);
  }

 private:
  struct Point {
    double x = NAN, y = NAN;
  };
  static bool known(const Point& p) { return !std::isnan(p.x) && !std::isnan(p.y); }
  Point sample(std::size_t i) const {
    const auto at = backwards_ ? x_.size() - 1 - i : i;
    return {sign_ * x_[at], y_[at]};
  }
  // The next place further on in x.
  Point next() {
    Point out;
    for (; taken_ < x_.size(); ++taken_) {
      const auto p = sample(taken_);
      if (!known(p)) continue;
      if (p.x > out.x) break;
      out = {std::isnan(out.x) ? p.x : out.x, p.y};
    }
    return out;
  }

  std::span<const double> x_, y_;
  bool backwards_;
  double sign_;
  std::size_t taken_ = 0;
  Point before_, after_;
  double start_ = NAN, end_ = -INFINITY;
};

// The area between both ways where they differ by less than `limit`; none unless x goes from its first sample
// to its far end and back once.
std::optional<double> there_and_back(std::span<const double> x, std::span<const double> y, double limit) {
  std::size_t far = 0;
  double travelled = 0, before = x.empty() ? NAN : x[0];
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (std::isnan(x[i])) continue;
    if (std::isnan(before)) before = x[i];
    travelled += std::abs(x[i] - before);
    before = x[i];
    if (!(std::abs(x[i] - x[0]) <= std::abs(x[far] - x[0]))) far = i;
  }
  const double span = x.empty() ? 0 : std::abs(x[far] - x[0]);
  if (!(travelled <= 2.1 * span)) return std::nullopt;
  const double sign = x[far] > x[0] ? 1 : -1;
  Branch out(x.first(far + 1), y.first(far + 1), false, sign);
  Branch back(x.subspan(far), y.subspan(far), true, sign);
  const double low = std::max(out.start(), back.start()), high = std::min(out.end(), back.end());
  if (!(low < high)) return 0;
  constexpr int steps = 4000;
  double area = 0;
  for (int i = 0; i < steps; ++i) {
    const double at = low + (high - low) * (i + 0.5) / steps;
    if (const double apart = std::abs(out.at(at) - back.at(at)); apart < limit) area += apart;
  }
  return area * (high - low) / steps;
}

// The same of a loop that may begin anywhere, since it is closed: where x is lowest, if not where it does.
std::optional<double> between_ways(std::span<const double> x, std::span<const double> y, double limit) {
  if (const auto area = there_and_back(x, y, limit)) return area;
  const auto range = extremes(x);
  if (!range) return std::nullopt;
  const auto from_lowest = [&](std::span<const double> values) {
    std::vector<double> out;
    out.reserve(values.size() + 1);
    for (std::size_t i = 0; i <= values.size(); ++i)
      out.push_back(values[(range->low_at + i) % values.size()]);
    return out;
  };
  return there_and_back(from_lowest(x), from_lowest(y), limit);
}

}  // namespace

double enclosed_area(std::span<const double> x, std::span<const double> y) {
  const auto area = between_ways(x, y, INFINITY);
  return area ? *area : std::abs(loop_integral(x, y));
}

double thin_area(std::span<const double> x, std::span<const double> y, double limit) {
  return between_ways(x, y, limit).value_or(0);
}

std::optional<Extremes> extremes(std::span<const double> values) {
  Extremes out{INFINITY, -INFINITY, 0, 0};
  for (std::size_t i = 0; i < values.size(); ++i) {  // NaN is neither less nor more
    if (values[i] < out.low) out.low = values[i], out.low_at = i;
    if (values[i] > out.high) out.high = values[i], out.high_at = i;
  }
  return out.low <= out.high ? std::optional(out) : std::nullopt;
}

std::vector<Crossing> crossings(std::span<const double> y, double level) {
  std::vector<Crossing> out;
  std::size_t before = y.size();
  for (std::size_t i = 0; i < y.size(); ++i) {
    if (std::isnan(y[i])) continue;
    if (before < y.size()) {
      const double a = y[before] - level, b = y[i] - level;
      if ((a < 0) != (b < 0) && a != b) out.push_back({before, i, a / (a - b)});
    }
    before = i;
  }
  return out;
}

}  // namespace ferrobench::recordings
