#include "model/inference/study/calibrate.h"

#include <algorithm>
#include <cmath>

#include "model/physics/wells.h"

namespace ferrobench::model {
namespace {

using recordings::Channel;
using recordings::Recording;

struct State {
  double time = 0, field = 0, force = 0, fraction = 0;
};

const std::vector<double>& needed(const Recording& r, Channel channel) {
  if (r.has(channel)) return r.at(channel);
  throw Error(ErrorCode::bad_recording, "the loop cannot be calibrated from",
              Problem{.path = "/entry/data/" + std::string(channel_name(channel)), .message = "is missing"});
}

std::vector<State> states_of(const Model& model, const Recording& r) {
  const auto& field = needed(r, Channel::field);
  const auto& displacement = needed(r, Channel::displacement);
  const auto& m = model.material;
  const auto& load = r.header.load;
  const auto& specimen = r.header.specimen;
  const auto constants = kinetic_constants(m);
  const double at_rest = -m.compliance_180 * load.prestress;
  std::vector<State> out;
  for (std::size_t i = 0; i < r.size(); ++i) {
    const double spring = load.spring_stiffness * displacement[i];
    const double stress = -load.prestress - spring / specimen.area;
    double active = displacement[i];
    if (model.actuator.passive_stiffness) active += spring / *model.actuator.passive_stiffness;
    const double strain = active / specimen.length + at_rest;
    const double ninety = m.compliance_90 * stress + m.remanent_strain_90;
    const double plus = m.compliance_180 * stress + m.piezoelectric_180 * field[i];
    const double fraction = std::clamp((strain - ninety) / (plus - ninety), 0.0, 1.0);
    if (std::isfinite(fraction))
      out.push_back({r.time[i], field[i], driving_forces(constants, {field[i], stress}).plus_90, fraction});
  }
  return out;
}

struct Crossing {
  double time = 0, force = 0, fraction = 0;
};

// Where x+ first reaches each level, in the order of the walk. down: x+ falls.
std::vector<Crossing> crossings(std::span<const State> walk, const std::vector<double>& levels, bool down) {
  std::vector<Crossing> out;
  std::size_t next = 0;
  for (std::size_t i = 1; i < walk.size() && next < levels.size(); ++i) {
    const auto& a = walk[i - 1];
    const auto& b = walk[i];
    while (next < levels.size() && (down ? b.fraction <= levels[next] : b.fraction >= levels[next])) {
      const double change = b.fraction - a.fraction;
      const double u = change == 0 ? 1 : std::clamp((levels[next] - a.fraction) / change, 0.0, 1.0);
      out.push_back({a.time + u * (b.time - a.time), a.force + u * (b.force - a.force), levels[next]});
      ++next;
    }
  }
  return out;
}

// Adds what the loop's own rate took off the critical force.
std::vector<CriticalForcePoint> branch_of(const Material& m, const std::vector<Crossing>& crossed,
                                          bool down) {
  const double thermal = boltzmann * m.temperature / m.activation_volume;
  std::vector<CriticalForcePoint> out;
  for (std::size_t i = 0; i < crossed.size(); ++i) {
    const auto& before = crossed[i == 0 ? 0 : i - 1];
    const auto& after = crossed[std::min(i + 1, crossed.size() - 1)];
    const double rate =
        std::abs(after.fraction - before.fraction) / std::max(after.time - before.time, 1e-300);
    const double left = std::max(down ? crossed[i].fraction : 1 - crossed[i].fraction, 1e-3);
    const double barrier = thermal * std::max(0.0, std::log(left / (m.relaxation_time * rate)));
    const double extra = 4 * std::sqrt(m.barrier * barrier);
    out.push_back({crossed[i].fraction, crossed[i].force + (down ? extra : -extra)});
  }
  if (down) std::reverse(out.begin(), out.end());
  return out;
}

CriticalForce table_of(const Model& model, const Recording& r, const CalibrateOptions& options) {
  auto states = states_of(model, r);
  if (states.empty()) throw Error(ErrorCode::bad_recording, "the loop has no finite sample");
  const auto by = [](double State::*member) {
    return [member](const State& a, const State& b) { return a.*member < b.*member; };
  };
  const auto [low, high] = std::minmax_element(states.begin(), states.end(), by(&State::field));
  const double low_field = low->field, high_field = high->field;
  if (low_field < -0.5 * high_field)
    throw Error(ErrorCode::bad_recording, "the loop goes too far below zero: both 180 phases take part",
                Problem{.path = "/entry/data/field",
                        .message = "has its lowest value at",
                        .given = low_field,
                        .allowed = -0.5 * high_field,
                        .unit = "V/m"});
  // The way up from the virgin state is not of the loop.
  states.erase(states.begin(), std::find_if(states.begin(), states.end(),
                                            [&](const State& s) { return s.field >= 0.98 * high_field; }));
  const auto lowest_fraction = std::min_element(states.begin(), states.end(), by(&State::fraction));
  // Down: from the last sample at the top before the lowest fraction. Up: from there on.
  const auto highest = [](auto begin, auto end) {
    double most = 0;
    for (auto i = begin; i != end; ++i) most = std::max(most, i->fraction);
    return most;
  };
  const double top =
      std::min(highest(states.begin(), lowest_fraction), highest(lowest_fraction, states.end()));
  const double bottom = lowest_fraction->fraction;
  if (top - bottom < options.smallest_range)
    throw Error(ErrorCode::bad_recording, "the loop hardly switches",
                Problem{.path = "/entry/data/displacement",
                        .message = "moves x+ by too little",
                        .given = top - bottom,
                        .allowed = options.smallest_range});
  auto begin = lowest_fraction;
  while (begin != states.begin() && (begin - 1)->fraction < top) --begin;
  if (begin != states.begin()) --begin;

  std::vector<double> falling;
  for (int i = 1; i < options.points; ++i) falling.push_back(top - (top - bottom) * i / options.points);
  std::vector<double> rising(falling.rbegin(), falling.rend());
  CriticalForce out;
  out.unload = branch_of(model.material, crossings({begin, lowest_fraction + 1}, falling, true), true);
  out.load = branch_of(model.material, crossings({lowest_fraction, states.end()}, rising, false), false);
  out.prestress = r.header.load.prestress;
  return out;
}

double mean_difference(const std::vector<CriticalForcePoint>& a, const std::vector<CriticalForcePoint>& b) {
  double sum = 0;
  int count = 0;
  for (const auto& p : a) {
    if (p.fraction < b.front().fraction || p.fraction > b.back().fraction) continue;
    sum += force_at(b, p.fraction) - p.force;
    ++count;
  }
  return count > 0 ? sum / count : 0;
}

// Makes the branches fall everywhere and keeps load below unload: see the header.
void clear_tips(CriticalForce& c) {
  auto& unload = c.unload;
  auto& load = c.load;
  const std::size_t n = unload.size();
  for (std::size_t i = 1; i < n; ++i) {
    unload[n - 1 - i].force = std::max(unload[n - 1 - i].force, unload[n - i].force);
    load[i].force = std::min(load[i].force, load[i - 1].force);
  }
  std::vector<double> gaps;
  for (std::size_t i = 0; i < n; ++i) gaps.push_back(unload[i].force - load[i].force);
  std::nth_element(gaps.begin(), gaps.begin() + static_cast<std::ptrdiff_t>(n / 2), gaps.end());
  const double least = 0.5 * gaps[n / 2];
  if (least <= 0)
    throw Error(ErrorCode::bad_recording, "the loop has no hysteresis",
                Problem{.path = "/entry/data/displacement",
                        .message = "comes back the way it went: median distance of the branches",
                        .given = 2 * least,
                        .unit = "J/m^3"});
  for (std::size_t i = 0; i < n; ++i) {
    if (i < n / 2)
      load[i].force = std::min(load[i].force, unload[i].force - least);
    else
      unload[i].force = std::max(unload[i].force, load[i].force + least);
  }
}

// Adds the ends x+ = 0 and x+ = 1: see the header.
void extend(CriticalForce& c) {
  const std::size_t n = c.unload.size(), quarter = n / 4;
  const auto slope = [](const CriticalForcePoint& a, const CriticalForcePoint& b) {
    return (b.force - a.force) / (b.fraction - a.fraction);
  };
  const auto bottom = c.unload.front(), top = c.load.back();
  const double down = -bottom.fraction * slope(bottom, c.unload[quarter]);
  const double up = (1 - top.fraction) * slope(c.load[n - 1 - quarter], top);
  c.unload.insert(c.unload.begin(), {0, bottom.force + down});
  c.load.insert(c.load.begin(), {0, c.load.front().force + down});
  c.unload.push_back({1, c.unload.back().force + up});
  c.load.push_back({1, top.force + up});
}

}  // namespace

Model calibrate_parametrized(const Model& model, const Recording& loop, const Recording* other_prestress,
                             const CalibrateOptions& options) {
  Model out = model;
  auto table = table_of(model, loop, options);
  if (other_prestress != nullptr) {
    const auto other = table_of(model, *other_prestress, options);
    const double change = other.prestress - table.prestress;
    if (std::abs(change) < 1e3)
      throw Error(ErrorCode::bad_recording, "both loops have the same prestress",
                  Problem{.path = "/entry/load/prestress_Pa",
                          .message = "is that of the first",
                          .given = other.prestress,
                          .unit = "Pa"});
    table.prestress_shift =
        0.5 * (mean_difference(table.unload, other.unload) + mean_difference(table.load, other.load)) /
        change;
  }
  clear_tips(table);
  extend(table);
  out.polycrystal = {};
  out.polycrystal.method = PolycrystalMethod::parametrized;
  out.polycrystal.critical_force = std::move(table);
  out.load = {loop.header.load.spring_stiffness, loop.header.load.prestress};
  return out;
}

}  // namespace ferrobench::model
