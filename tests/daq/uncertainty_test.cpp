// The stated uncertainty of every figure against the truth: one simulation without noise, read through the
// virtual bench's sensors and converters 200 times with noise of other seeds.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <iostream>
#include <map>

#include "daq/virtual/config.h"
#include "model/simulator.h"
#include "recordings/reports/report.h"
#include "tests/daq/coverage.h"

namespace ferrobench::daq {
namespace {

using recordings::Channel;
using recordings::Recording;

constexpr int runs = 200;

struct Knot {
  double time, level;  // s, V/m
};

constexpr std::array measured{Channel::field, Channel::charge, Channel::displacement, Channel::force};

Recording truth(const model::Model& model, const std::vector<Knot>& knots, double rate) {
  Recording r;
  r.header.specimen = {model.name, model.actuator.length, model.actuator.area, model.actuator.layer_thickness,
                       model.actuator.layer_count};
  r.header.load = {model.load.spring_stiffness, model.load.prestress};
  auto& command = r.set(Channel::command);
  const auto rows = static_cast<std::size_t>(std::lround(knots.back().time * rate));
  std::size_t leg = 0;
  for (std::size_t i = 0; i <= rows; ++i) {
    const double t = static_cast<double>(i) / rate;
    while (leg + 2 < knots.size() && t > knots[leg + 1].time) ++leg;
    const auto &a = knots[leg], &b = knots[leg + 1];
    r.time.push_back(t);
    command.push_back(a.level + (b.level - a.level) * (t - a.time) / (b.time - a.time));
  }
  for (std::size_t k = 1; k < knots.size(); ++k) {
    const auto row = [rate](const Knot& knot) { return std::lround(knot.time * rate); };
    const double change = std::abs(knots[k].level - knots[k - 1].level);
    r.segments.push_back({row(knots[k - 1]), row(knots[k]), change > 0 ? "ramp" : "hold", "", knots[k].level,
                          change / (knots[k].time - knots[k - 1].time)});
  }
  auto t = model::simulate(model, r.time, command, {.tolerance = 1e-5, .domains = 20000});
  r.set(Channel::field) = std::move(t.field);
  r.set(Channel::charge) = std::move(t.charge);
  r.set(Channel::displacement) = std::move(t.displacement);
  r.set(Channel::force) = std::move(t.force);
  r.noise.fill(0);
  return r;
}

// What is added to the values of a channel before its converter: std times what this gives.
using Coloured = std::function<void(std::uint64_t seed, double std, std::vector<double>& values)>;

Recording seen(const Recording& truth, const std::array<Sensor, 5>& sensors, std::uint64_t seed,
               const Coloured& coloured) {
  Recording r = truth;
  r.noise.fill(std::nullopt);
  auto& raw = r.raw.emplace();
  raw.counts.resize(r.size() * measured.size());
  for (std::size_t c = 0; c < measured.size(); ++c) {
    auto sensor = sensors[static_cast<std::size_t>(measured[c])];
    auto& values = r.set(measured[c]);
    values = truth.at(measured[c]);
    if (coloured) coloured(10 * seed + c, std::exchange(sensor.noise, 0), values);
    const Converter converter(measured[c], sensor, seed);
    raw.columns.push_back(converter.column());
    EXPECT_FALSE(converter.convert(0, values, raw.counts.data() + c, measured.size()));
    for (std::size_t i = 0; i < values.size(); ++i)
      values[i] = converter.column().gain * raw.counts[i * measured.size() + c];
  }
  return r;
}

struct Figures {
  struct Figure {
    double value = 0, uncertainty = 0;
  };
  std::map<std::string, Figure> of;

  explicit Figures(const Recording& r) {
    for (const auto& table : recordings::make_report(r).tables)
      for (std::size_t row = 0; row < table.rows.size(); ++row)
        for (std::size_t c = 0; c < table.columns.size(); ++c) {
          const auto* value = std::get_if<double>(&table.rows[row][c]);
          if (value == nullptr) continue;
          const auto u = table.uncertainty.find({row, c});
          of[table.key + ' ' + std::to_string(row) + ' ' + table.columns[c].key] = {
              *value, u == table.uncertainty.end() ? 0 : u->second};
        }
  }
};

// The virtual bench's noise, times this: enough for the grain of a simulation with few domains not to matter.
constexpr double noise_times = 4;

void expect_coverage(const std::vector<Knot>& knots, double rate, const std::vector<std::string>& wanted,
                     const Coloured& coloured = {}, double least = 92) {
  const auto model = model::library_model("soft-pzt");
  auto sensors = sensors_of({}, model);
  for (auto& sensor : sensors) sensor.noise *= noise_times;
  const auto exact = truth(model, knots, rate);
  const Figures true_figures(exact);
  std::map<std::string, Coverage> by_column;  // of all cycles, holds or pulses
  for (std::uint64_t seed = 1; seed <= runs; ++seed)
    for (const auto& [name, figure] : Figures(seen(exact, sensors, seed, coloured)).of) {
      const auto true_figure = true_figures.of.find(name);
      if (figure.uncertainty == 0 || true_figure == true_figures.of.end()) continue;
      by_column[name.substr(0, name.find(' ')) + name.substr(name.rfind(' '))].take(
          (figure.value - true_figure->second.value) / figure.uncertainty);
    }
  for (const auto& [name, count] : by_column)
    std::cout << name << ": " << count.percent() << " % of " << count.figures << " within 2 u, errors of "
              << count.rms() << " u (mean " << count.sum / count.figures << " u)\n";
  for (const auto& name : wanted) {
    const auto& count = by_column[name];
    ASSERT_GE(count.figures, 0.9 * runs) << name;  // some have none where noise leaves several places
    // An uncertainty too small by 1.5 would cover 82 %, one too large by 1.5 would have errors of 0.67 u.
    EXPECT_GE(count.percent(), least) << name;
    EXPECT_LE(count.percent(), 98) << name;
    EXPECT_GE(count.rms(), 0.8) << name;
    EXPECT_LE(count.rms(), 1.25) << name;
  }
}

const std::vector<std::string> loop_figures{"stroke stroke_um",
                                            "stroke strain_percent",
                                            "stroke force_span_N",
                                            "hysteresis displacement_area_um_kV_per_mm",
                                            "hysteresis width_kV_per_mm",
                                            "hysteresis coercive_negative_kV_per_mm",
                                            "hysteresis coercive_positive_kV_per_mm",
                                            "hysteresis remanent_falling_C_per_m2",
                                            "hysteresis remanent_rising_C_per_m2",
                                            "hysteresis energy_J_per_m3"};

const std::vector<Knot> loops{{0, 0},    {1, 2e6}, {3, -2e6},  {5, 2e6},
                              {7, -2e6}, {9, 2e6}, {11, -2e6}, {12, 0}};

TEST(Uncertainty, CoversStrokeAndHysteresis) {
  expect_coverage(loops, 1000, loop_figures);
}

// How samples go together is estimated as well, which leaves a little more beyond two standard uncertainties;
// taken for white, such noise would leave 40 %.
TEST(Uncertainty, CoversThemWhereNeighboursGoTogether) {
  expect_coverage(loops, 1000, loop_figures, add_coloured, 90);
}

TEST(Uncertainty, CoversCreep) {
  expect_coverage({{0, 0}, {1, 1.5e6}, {2, -5e5}, {17, -5e5}, {18, 1.5e6}, {18.5, 1.5e6}, {19, 0}, {34, 0}},
                  200,
                  {"creep displacement_change_um", "creep displacement_rate_um_per_decade",
                   "creep polarization_change_C_per_m2", "creep polarization_rate_C_per_m2_per_decade"});
}

TEST(Uncertainty, CoversSwitchedCharge) {
  // Down, then P, U, N, D, with time to come to rest between.
  std::vector<Knot> knots{{0, 0}};
  const auto pulse = [&](double level) {
    const double t = knots.back().time;
    knots.push_back({t + 0.1, level});
    knots.push_back({t + 0.2, 0});
    knots.push_back({t + 0.4, 0});
  };
  for (const double level : {-2e6, 2e6, 2e6, -2e6, -2e6}) pulse(level);
  expect_coverage(knots, 2000,
                  {"pund P_C_per_m2", "pund U_C_per_m2", "pund N_C_per_m2", "pund D_C_per_m2",
                   "pund switched_C_per_m2", "pund non_switched_C_per_m2", "pund switched_left_C_per_m2"});
}

}  // namespace
}  // namespace ferrobench::daq
