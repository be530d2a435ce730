// A recording as a measurement without noise on a model would give it.
#pragma once

#include "recordings/format/recording.h"
#include "tests/model/effects_support.h"

namespace ferrobench::model {

// Free to move, and quick enough for programs of tenths of a second.
inline Model quick_specimen() {
  auto m = library_model("soft-pzt");
  m.material.relaxation_time = 1e-3;
  m.load = {};
  return m;
}

inline recordings::Recording measured_on(const Model& m, const Program& p,
                                         const SimulationOptions& options = {}) {
  using recordings::Channel;
  const auto t = simulate(m, p.time, p.field, options);
  recordings::Recording r;
  r.header.title = m.name;
  r.header.specimen = {m.name, m.actuator.length, m.actuator.area, m.actuator.layer_thickness,
                       m.actuator.layer_count};
  r.header.load = {m.load.spring_stiffness, m.load.prestress};
  r.time = p.time;
  r.set(Channel::command) = p.field;
  r.set(Channel::field) = t.field;
  r.set(Channel::charge) = t.charge;
  r.set(Channel::displacement) = t.displacement;
  r.set(Channel::force) = t.force;
  return r;
}

}  // namespace ferrobench::model
