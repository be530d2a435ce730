#include "tests/campaign/programs.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::campaign {
namespace {

class Path {
 public:
  Path(std::string name, double interval) : interval_(interval) {
    out_.name = std::move(name);
    out_.time = {0};
    out_.command = {0};
  }
  Path& to(double level, double rate) {
    const double from = out_.command.back();
    return go(level, std::abs(level - from) / rate);
  }
  Path& hold(double duration) { return go(out_.command.back(), duration); }
  FieldProgram with(double prestress, double spring) {
    out_.prestress = prestress;
    out_.spring = spring;
    return out_;
  }

 private:
  Path& go(double level, double duration) {
    const double from = out_.command.back();
    const int n = std::max(1, static_cast<int>(std::lround(duration / interval_)));
    for (int i = 1; i <= n; ++i) {
      out_.time.push_back(static_cast<double>(out_.time.size()) * interval_);
      out_.command.push_back(i == n ? level : from + (level - from) * i / n);
    }
    return *this;
  }
  double interval_;
  FieldProgram out_;
};

}  // namespace

std::vector<FieldProgram> draw_programs(std::mt19937_64& random, double top) {
  const auto about = [&](double v) { return v * std::uniform_real_distribution<double>(0.8, 1.25)(random); };
  std::vector<FieldProgram> out;

  const double slow = about(5e5);
  Path slow_loops("slow_loops", 8 * top / slow / 4500);
  slow_loops.to(-top, slow).to(top, slow).to(-top, slow).to(top, slow).to(0, slow);
  out.push_back(slow_loops.with(1, 1));

  const double fast = about(3e7);
  Path fast_loops("fast_loops", 14 * top / fast / 4500);
  for (int i = 0; i < 3; ++i) fast_loops.to(-top, fast).to(top, fast);
  fast_loops.to(0, fast).hold(0.05 * top / fast);
  out.push_back(fast_loops.with(1, 1));

  const double unipolar_rate = about(2e6);
  Path unipolar("unipolar", 7.4 * top / unipolar_rate / 3000);
  for (int i = 0; i < 3; ++i) unipolar.to(top, unipolar_rate).to(0, unipolar_rate);
  unipolar.to(-about(0.15) * top, unipolar_rate).to(top, unipolar_rate).to(0, unipolar_rate);
  out.push_back(unipolar.with(1, about(0.4)));

  const auto holds = [&](const std::string& name, double prestress) {
    const double rate = 5e6, hold = about(8);
    Path path(name, 5.5 * hold / 4000);
    for (const double level : {0.15, 0.25, 0.35, 0.5, 0.8}) {
      path.to(-about(level) * top, rate).hold(hold);
      path.to(top, rate).to(0, rate);
    }
    out.push_back(path.with(prestress, 1));
  };
  holds("holds_low_prestress", 1);
  holds("holds_high_prestress", about(1.7));

  const double minor_rate = about(4e6);
  Path minor("minor_loops", 11 * top / minor_rate / 4500);
  minor.to(-top, minor_rate);
  double level = 1;
  for (int i = 0; i < 14; ++i) {
    level *= -about(0.85);
    minor.to(std::clamp(level, -1.0, 1.0) * top, minor_rate);
  }
  minor.to(0, minor_rate);
  out.push_back(minor.with(1, 1));

  Path steps("fast_steps", 3.2 / 3500);
  for (int i = 0; i < 12; ++i) {
    const double side = i % 2 == 0 ? -1 : 1;
    steps.to(side * std::uniform_real_distribution<double>(0.2, 1)(random) * top, 3e8).hold(about(0.25));
  }
  steps.to(0, 3e8).hold(0.1);
  out.push_back(steps.with(1, 1));

  const double rest_rate = about(2e6);
  Path rest("rest", 0.02);
  rest.to(top, rest_rate).to(-top, rest_rate).to(0, rest_rate).hold(about(18));
  rest.to(top, rest_rate).to(0, rest_rate).hold(about(18));
  out.push_back(rest.with(1, 1));
  return out;
}

}  // namespace ferrobench::campaign
