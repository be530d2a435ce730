#include "recordings/analysis/thinning.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::recordings {
namespace {

struct Vector {
  double x, y;
};
double cross(Vector a, Vector b) {
  return a.x * b.y - a.y * b.x;
}
double dot(Vector a, Vector b) {
  return a.x * b.x + a.y * b.y;
}

// The directions from one point that pass near all that followed it.
class Cone {
 public:
  explicit Cone(double near) : near_(near) {}

  // Whether the line may end at this point, seen from its start; narrows the directions if so.
  bool takes(Vector p) {
    const double distance = std::hypot(p.x, p.y);
    if (distance < farthest_ - near_) return false;
    if (distance > near_) {
      const double s = near_ / distance, c = std::sqrt(1 - s * s);
      const Vector right{p.x * c + p.y * s, p.y * c - p.x * s}, left{p.x * c - p.y * s, p.y * c + p.x * s};
      if (!narrowed_) {
        narrowed_ = true;
        right_ = right;
        left_ = left;
      } else {
        if (dot(right_, p) <= 0 || cross(right_, p) < 0 || cross(p, left_) < 0) return false;
        if (cross(right_, right) > 0) right_ = right;
        if (cross(left, left_) > 0) left_ = left;
      }
    }
    farthest_ = std::max(farthest_, distance);
    return true;
  }

 private:
  double near_, farthest_ = 0;
  bool narrowed_ = false;
  Vector right_{}, left_{};
};

std::vector<std::size_t> cut(std::span<const double> time, std::size_t rows, double duration) {
  std::vector<std::size_t> begins;
  const auto pause_before = [&](std::size_t i) {
    return i > 0 && i < time.size() && time[i] - time[i - 1] > duration;
  };
  for (std::size_t i = 0; i < time.size(); ++i)
    if (i == 0 || i - begins.back() >= rows || time[i] - time[begins.back()] > duration ||
        pause_before(i - 1) || pause_before(i + 1))
      begins.push_back(i);
  return begins;
}

}  // namespace

std::vector<std::size_t> thin(std::span<const double> x, std::span<const double> y, double x_unit,
                              double y_unit, double error) {
  std::vector<std::size_t> kept;
  const auto missing = [&](std::size_t i) { return std::isnan(x[i]) || std::isnan(y[i]); };
  const auto from = [&](std::size_t start, std::size_t i) {
    return Vector{(x[i] - x[start]) / x_unit, (y[i] - y[start]) / y_unit};
  };
  Cone cone(error / 2);
  bool broken = true;  // no line is under way
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (missing(i)) {
      if (i > 0 && !missing(i - 1)) {
        if (kept.back() != i - 1) kept.push_back(i - 1);
        kept.push_back(i);
      }
      broken = true;
    } else if (broken) {
      kept.push_back(i);
      cone = Cone(error / 2);
      broken = false;
    } else if (!cone.takes(from(kept.back(), i))) {
      if (kept.back() != i - 1) kept.push_back(i - 1);
      cone = Cone(error / 2);
      if (!cone.takes(from(kept.back(), i))) kept.push_back(i);
    }
  }
  if (!broken && kept.back() + 1 != x.size()) kept.push_back(x.size() - 1);
  return kept;
}

Thinned thin_to(std::span<const double> x, std::span<const double> y, double x_unit, double y_unit,
                double error, std::size_t most) {
  constexpr int tries = 24;
  Thinned out{.kept = thin(x, y, x_unit, y_unit, error), .error = error};
  for (int i = 0; i < tries && out.kept.size() > most; ++i) {
    out.error *= 2;
    out.kept = thin(x, y, x_unit, y_unit, out.error);
  }
  return out;
}

std::vector<std::size_t> stretches(std::span<const double> time, std::size_t most) {
  if (time.empty()) return {};
  for (auto shares = most; shares > 1; shares -= (shares + 3) / 4) {
    auto begins = cut(time, (time.size() + shares - 1) / shares,
                      (time.back() - time.front()) / static_cast<double>(shares));
    if (begins.size() <= most) return begins;
  }
  return {0};
}

}  // namespace ferrobench::recordings
