// The loads at the end of a step and the fractions they bring about depend on each other: a fixed point in at
// most two unknowns, field and stress. Broyden's method, with the slope remembered from step to step.
#pragma once

#include <array>

#include "model/physics/wells.h"

namespace ferrobench::model {

class Coupling {
 public:
  struct Scale {
    double field = 1;   // V/m that change ln(rate) by about 1
    double stress = 1;  // Pa that do
  };
  struct Answer {
    Loads loads;                 // that the fractions bring about
    double plus = 0, minus = 0;  // mean fractions
  };

  void reset() { *this = {}; }

  struct Accuracy {
    double tolerance = 0;    // of the mean fractions
    double agreement = 0;    // of the loads, in their scales
    double exact = 1e-9;     // loads that agree so well are taken whatever the fractions do
    double good_enough = 0;  // likewise once all evaluations are spent
    int evaluations = 12;
  };

  // Calls evaluate(loads) until the loads it answers with agree with those given so well that the mean
  // fractions would not change by more than the tolerance. False if that does not come about.
  template <class Evaluate>
  bool solve(Loads first, const Scale& scale, const Accuracy& accuracy, Evaluate&& evaluate) {
    std::array<double, 2> u{first.field / scale.field, first.stress / scale.stress};
    std::array<double, 2> last_u{}, last_residual{};
    double last_plus = 0, last_minus = 0;
    double size = 0;  // of the last step
    for (int i = 0; i < accuracy.evaluations; ++i) {
      const Answer answer = evaluate(Loads{u[0] * scale.field, u[1] * scale.stress});
      const std::array<double, 2> residual{answer.loads.field / scale.field - u[0],
                                           answer.loads.stress / scale.stress - u[1]};
      if (i > 0) {
        learn({u[0] - last_u[0], u[1] - last_u[1]},
              {residual[0] - last_residual[0], residual[1] - last_residual[1]});
        const double moved = norm({u[0] - last_u[0], u[1] - last_u[1]});
        if (moved > 1e-9)
          sensitivity_ = (abs(answer.plus - last_plus) + abs(answer.minus - last_minus)) / moved;
      }
      const auto step = newton(residual);
      size = norm(step);
      if (!(size < 1e6)) break;
      if (size < accuracy.exact || (size < accuracy.agreement && size * sensitivity_ < accuracy.tolerance)) {
        if (i > 0 || known_) {
          known_ = true;
          return true;
        }
      }
      last_u = u;
      last_residual = residual;
      last_plus = answer.plus;
      last_minus = answer.minus;
      // A step of many kT says that the slope is wrong, not that the loads are there.
      const double shorten = size > 4 ? 4 / size : 1;
      u[0] += shorten * step[0];
      u[1] += shorten * step[1];
    }
    if (size < accuracy.good_enough) return true;
    reset();
    return false;
  }

 private:
  static double abs(double v) { return v < 0 ? -v : v; }
  static double norm(const std::array<double, 2>& v) { return abs(v[0]) + abs(v[1]); }

  // Broyden's update of the residual's slope.
  void learn(const std::array<double, 2>& du, const std::array<double, 2>& dr) {
    const double square = du[0] * du[0] + du[1] * du[1];
    if (square < 1e-24) return;
    for (std::size_t i = 0; i < 2; ++i) {
      const double miss = (dr[i] - slope_[i][0] * du[0] - slope_[i][1] * du[1]) / square;
      slope_[i][0] += miss * du[0];
      slope_[i][1] += miss * du[1];
    }
  }

  std::array<double, 2> newton(const std::array<double, 2>& r) const {
    const double determinant = slope_[0][0] * slope_[1][1] - slope_[0][1] * slope_[1][0];
    return {-(slope_[1][1] * r[0] - slope_[0][1] * r[1]) / determinant,
            -(slope_[0][0] * r[1] - slope_[1][0] * r[0]) / determinant};
  }

  std::array<std::array<double, 2>, 2> slope_{{{-1, 0}, {0, -1}}};
  double sensitivity_ = 1;
  bool known_ = false;
};

}  // namespace ferrobench::model
