#include "tests/campaign/base_models.h"

namespace ferrobench::campaign {

model::Model draw_base(Draw& draw) {
  model::Model m = model::library_model("soft-pzt");
  m.name = "bench";
  m.notes.clear();
  auto& a = m.material;
  a.remanent_polarization = draw.between(0.24, 0.36);
  a.remanent_strain_90 = -draw.decades(0.0018, 0.004);
  a.permittivity_180 = draw.decades(1.5e-8, 3.5e-8);
  a.permittivity_90 = draw.decades(1.5e-8, 3.5e-8);
  a.compliance_180 = draw.between(1.3e-11, 2e-11);
  a.compliance_90 = draw.between(1.4e-11, 2.2e-11);
  a.piezoelectric_180 = draw.between(3.5e-10, 7e-10);
  a.barrier = draw.decades(3.5e4, 6.5e4);
  a.relaxation_time = draw.decades(1e-4, 2e-2);
  a.activation_volume = draw.decades(1.5e-24, 3e-24);
  m.polycrystal.method = model::PolycrystalMethod::distribution;
  m.polycrystal.barrier_log_std = draw.between(0.2, 0.4);
  m.polycrystal.interaction_field_std = draw.between(5e4, 1.3e5);
  m.polycrystal.interaction_stress_std = draw.between(2e6, 8e6);
  m.polycrystal.bias_field = draw.chance(0.5) ? 0 : draw.sign() * draw.between(2e4, 1e5);
  m.actuator.length = draw.between(0.008, 0.02);
  m.actuator.layer_count =
      static_cast<std::int64_t>(std::lround(m.actuator.length / m.actuator.layer_thickness));
  if (draw.chance(0.35)) m.actuator.passive_stiffness = draw.decades(3e7, 3e8);
  m.load = {.spring_stiffness = draw.decades(1e6, 4e6), .prestress = draw.between(4e6, 1e7)};
  return m;
}

std::vector<double*> base_parameters(model::Model& m) {
  std::vector<double*> values{&m.material.remanent_polarization,
                              &m.material.remanent_strain_90,
                              &m.material.permittivity_180,
                              &m.material.permittivity_90,
                              &m.material.compliance_180,
                              &m.material.compliance_90,
                              &m.material.piezoelectric_180,
                              &m.material.barrier,
                              &m.material.relaxation_time,
                              &m.material.activation_volume,
                              &m.polycrystal.barrier_log_std,
                              &m.polycrystal.interaction_field_std,
                              &m.polycrystal.interaction_stress_std,
                              &m.polycrystal.bias_field};
  if (m.actuator.passive_stiffness) values.push_back(&*m.actuator.passive_stiffness);
  return values;
}

model::Model move_parameters(const model::Model& given, Draw& draw, int far) {
  model::Model m = given;
  const auto values = base_parameters(m);
  for (auto* value : values) *value *= 1 + draw.sign() * draw.between(0.05, 0.1);
  for (int i = 0; i < far; ++i)
    *values[draw.below(values.size())] *= 1 + draw.sign() * draw.between(0.1, 0.2);
  m.load.spring_stiffness *= 1 + draw.sign() * draw.between(0.01, 0.02);
  m.load.prestress *= 1 + draw.sign() * draw.between(0.01, 0.02);
  return m;
}

}  // namespace ferrobench::campaign
