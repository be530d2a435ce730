#include "tests/bench/odeint_domain.h"

#include <algorithm>
#include <boost/numeric/odeint.hpp>
#include <boost/numeric/odeint/stepper/rosenbrock4_dense_output.hpp>
#include <cmath>

namespace ferrobench::bench {
namespace {

namespace odeint = boost::numeric::odeint;
using Vector = boost::numeric::ublas::vector<double>;
using Matrix = boost::numeric::ublas::matrix<double>;

// One domain: barriers by the law of equal curvature.
struct Domain {
  OdeintDomain k;
  const StressPath* path;
  const CreepPiece* piece;
  std::size_t index;

  struct Rates {
    double r[4];       // 1/s
    double change[4];  // d ln(r) / dt, 1/s
  };

  Rates rates(double t, bool with_change) const {
    const auto given = path->at(index, t);
    const double e = piece->from + piece->slope() * (t - piece->start) + k.field, s = given.stress + k.stress;
    const double common = -k.half_permittivity * e * e - k.half_compliance * s * s + s * k.strain_90;
    const double apart = e * (k.polarization + k.piezoelectric * s);
    const double force[4] = {common - apart, apart - common, -common - apart, common + apart};
    const double barrier = k.barrier, inverse = 1 / barrier, per_tau = 1 / k.relaxation_time;
    Rates out;
    for (int j = 0; j < 4; ++j) {
      const double inside = std::min(4 * barrier, std::max(-4 * barrier, force[j]));
      const double root = 0.25 * inside - barrier;
      const double dg = root * root * inverse + std::max(0.0, -force[j] - 4 * barrier);
      out.r[j] = per_tau * std::exp(-k.inverse_energy * dg);
    }
    if (!with_change) return out;
    const double even = -2 * k.half_permittivity * e * piece->slope() +
                        (k.strain_90 - 2 * k.half_compliance * s) * given.rate;
    const double odd =
        (k.polarization + k.piezoelectric * s) * piece->slope() + e * k.piezoelectric * given.rate;
    const double moved[4] = {even - odd, odd - even, -even - odd, even + odd};
    for (int j = 0; j < 4; ++j)
      out.change[j] =
          k.inverse_energy * std::min(1.0, std::max(0.0, 0.5 - 0.125 * force[j] * inverse)) * moved[j];
    return out;
  }
};

struct Slope {
  const Domain* domain;
  void operator()(const Vector& x, Vector& out, double t) const {
    const auto q = domain->rates(t, false);
    const double ninety = 1 - x[0] - x[1];
    out[0] = q.r[1] * ninety - q.r[0] * x[0];
    out[1] = q.r[2] * ninety - q.r[3] * x[1];
  }
};
struct Jacobian {
  const Domain* domain;
  void operator()(const Vector& x, Matrix& j, double t, Vector& by_time) const {
    const auto q = domain->rates(t, true);
    const double ninety = 1 - x[0] - x[1];
    j(0, 0) = -q.r[0] - q.r[1];
    j(0, 1) = -q.r[1];
    j(1, 0) = -q.r[2];
    j(1, 1) = -q.r[2] - q.r[3];
    by_time[0] = q.r[1] * q.change[1] * ninety - q.r[0] * q.change[0] * x[0];
    by_time[1] = q.r[2] * q.change[2] * ninety - q.r[3] * q.change[3] * x[1];
  }
};

}  // namespace

void add_domain(const OdeintDomain& k, const std::vector<CreepPiece>& pieces, const StressPath& path,
                const PeerOptions& options, std::vector<double>& plus, std::vector<double>& minus) {
  Domain domain{k, &path, nullptr, 0};
  auto stepper = odeint::make_dense_output(options.absolute, options.relative, odeint::rosenbrock4<double>());
  Vector x(2), between(2);
  x[0] = 1;
  x[1] = 0;
  std::size_t row = 0;
  double step = 1e-3;
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    const auto& piece = pieces[p];
    domain.piece = &piece;
    domain.index = p;
    const auto system = std::make_pair(Slope{&domain}, Jacobian{&domain});
    const double end = piece.start + piece.duration;
    const auto add = [&](double a, double b) {
      plus[row] += k.weight * a;
      minus[row] += k.weight * b;
      ++row;
    };
    std::size_t next = 0;
    stepper.initialize(x, piece.start, std::min(step, piece.duration));
    double time = piece.start;
    while (time < end) {
      if (time + stepper.current_time_step() > end)
        stepper.initialize(Vector(stepper.current_state()), time, end - time);
      else
        step = stepper.current_time_step();
      stepper.do_step(system);
      time = stepper.current_time();
      if (end - time < 1e-12 * end) time = end;
      const auto& now = stepper.current_state();
      // Interpolation is left out where nothing happened.
      const bool still = std::abs(now[0] - stepper.previous_state()[0]) < 1e-9 &&
                         std::abs(now[1] - stepper.previous_state()[1]) < 1e-9;
      for (; next < piece.times.size() && piece.times[next] <= time; ++next) {
        if (still) {
          add(now[0], now[1]);
        } else {
          stepper.calc_state(piece.times[next], between);
          add(between[0], between[1]);
        }
      }
    }
    x = stepper.current_state();
    for (; next < piece.times.size(); ++next) add(x[0], x[1]);
  }
}

}  // namespace ferrobench::bench
