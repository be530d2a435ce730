// The program and the stress as the peers see them. C++17, as far as Boost's ublas goes.
#pragma once

#include <cstddef>
#include <vector>

namespace ferrobench::bench {

struct CreepPiece {
  double start = 0, duration = 0;  // s
  double from = 0, to = 0;         // V/m
  std::vector<double> times;       // of the outputs in (start, start + duration], s
  double slope() const { return (to - from) / duration; }
};

// Stress in time: constant, or a cubic spline of even steps inside each piece.
class StressPath {
 public:
  explicit StressPath(double constant) : constant_(constant) {}
  // `fine` is the same program with outputs at a higher rate, `stress` what came out there; the first value
  // is that at time 0.
  StressPath(const std::vector<CreepPiece>& fine, double first, const std::vector<double>& stress);
  struct Value {
    double stress = 0, rate = 0;  // Pa, Pa/s
  };
  Value at(std::size_t piece, double time) const;

 private:
  struct Knots {
    std::vector<double> time, stress, slope;
  };
  double constant_ = 0;
  std::vector<Knots> pieces_;
};

struct PeerOptions {
  double relative = 1e-4;
  double absolute = 1e-6;
};

}  // namespace ferrobench::bench
