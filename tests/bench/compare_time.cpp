#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <limits>
#include <span>
#include <string>

#include "tests/bench/compare.h"
#include "tests/bench/cpu_time.h"
#include "tests/bench/ours.h"
#include "tests/bench/peer_cvode.h"
#include "tests/bench/peer_odeint.h"

namespace ferrobench::bench {
namespace {

struct Point {
  double error = 0, time = 0;
};

// CPU time at an error: the best of all settings, on straight lines between them in the logarithms. Only
// points that no other beats in both count; past the most exact one the time is not known.
double time_at(const std::vector<Point>& points, double error) {
  double best = std::numeric_limits<double>::infinity();
  for (const auto& a : points) {
    if (a.error <= error) best = std::min(best, a.time);
    for (const auto& b : points) {
      if (!(a.error > error && b.error < error)) continue;
      const double u = std::log(a.error / error) / std::log(a.error / b.error);
      best = std::min(best, std::exp((1 - u) * std::log(a.time) + u * std::log(b.time)));
    }
  }
  return best;
}

struct Method {
  std::string name;
  std::vector<Point> points;
};

void row(const std::string& name, const std::string& settings, const Point& p, const std::string& rest = "") {
  std::printf("| %s | %s | %.1e | %.2f | %s |\n", name.c_str(), settings.c_str(), p.error, 1e3 * p.time,
              rest.c_str());
  static_cast<void>(std::fflush(stdout));
}

std::string text(const char* format, double a, double b = 0) {
  std::array<char, 80> out{};
  static_cast<void>(std::snprintf(out.data(), out.size(), format, a, b));
  return out.data();
}

}  // namespace

void compare_time_stepping(double spring_stiffness) {
  const auto creep = make_creep(spring_stiffness);
  const double prestress = creep.model.load.prestress;
  const auto ours = [&](double tolerance) {
    return run_ours(creep, {.tolerance = tolerance, .domains = 1024, .shift = 0});
  };
  StressPath path(-prestress);
  if (spring_stiffness != 0) {
    const auto fine = make_creep(spring_stiffness, 1000);
    const auto run = run_ours(fine, {.tolerance = 1e-7, .domains = 1024, .shift = 0});
    path = StressPath(fine.pieces, run.first_stress, run.outputs.stress);
  }
  const auto limit_ours = ours(1e-7).outputs.polarization;
  const auto limit_cvode = run_cvode(creep, {1e-9, 1e-11}).polarization;
  const auto limit_rosenbrock = run_rosenbrock4(creep, path, {1e-9, 1e-9}).polarization;

  std::printf("\n## CPU time at equal error, %s (%zu domains, %zu outputs)\n\n",
              spring_stiffness == 0 ? "constant stress" : "spring of 2.7e6 N/m", creep.domains.size(),
              creep.outputs);
  std::printf("Limits apart, rms of P over its range: CVODE %.1e, rosenbrock4 %.1e from ferrobench's.\n\n",
              rms_over_range(limit_cvode, limit_ours), rms_over_range(limit_rosenbrock, limit_ours));
  std::printf("| method | tolerance | error in P | CPU ms | remarks |\n|---|---|---|---|---|\n");

  std::array<Method, 3> methods{{{"ferrobench", {}}, {"CVODE", {}}, {"rosenbrock4", {}}}};
  for (const double tolerance : {1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5}) {
    OurRun run;
    const double time = least_time([&] { run = ours(tolerance); }, 5, 0.5);
    methods[0].points.push_back({rms_over_range(run.outputs.polarization, limit_ours), time});
    row("ferrobench", text("%.0e", tolerance), methods[0].points.back(),
        text("own estimate %.1e, %.0f thousand domain-steps", run.statistics.time_error,
             static_cast<double>(run.statistics.domain_steps) / 1e3));
  }
  const auto peer = [&](Method& method, std::span<const double> tolerances, std::span<const double> shares,
                        const std::vector<double>& limit,
                        const std::function<Outputs(const PeerOptions&)>& run) {
    for (const double tolerance : tolerances)
      for (const double share : shares) {
        Outputs out;
        const double time = least_time([&] { out = run({tolerance, share * tolerance}); }, 3);
        method.points.push_back({rms_over_range(out.polarization, limit), time});
        row(method.name, text("rtol %.0e, atol %.0e", tolerance, share * tolerance), method.points.back());
      }
  };
  constexpr std::array cvode_tolerances{1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5};
  constexpr std::array cvode_shares{1.0, 0.1, 0.01};
  peer(methods[1], cvode_tolerances, cvode_shares, limit_cvode,
       [&](const PeerOptions& options) { return run_cvode(creep, options); });
  constexpr std::array rosenbrock_tolerances{1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 1e-4};
  constexpr std::array rosenbrock_shares{1.0, 0.1};
  peer(methods[2], rosenbrock_tolerances, rosenbrock_shares, limit_rosenbrock,
       [&](const PeerOptions& options) { return run_rosenbrock4(creep, path, options); });

  std::printf(
      "\n| at an error of | ferrobench ms | CVODE ms | ratio | rosenbrock4 ms | ratio "
      "|\n|---|---|---|---|---|---|\n");
  for (const double error : {1e-3, 1e-4}) {
    const double own = time_at(methods[0].points, error), cvode = time_at(methods[1].points, error),
                 rosenbrock = time_at(methods[2].points, error);
    std::printf("| %.0e | %.2f | %.1f | %.0f | %.1f | %.0f |\n", error, 1e3 * own, 1e3 * cvode, cvode / own,
                1e3 * rosenbrock, rosenbrock / own);
  }
}

}  // namespace ferrobench::bench
