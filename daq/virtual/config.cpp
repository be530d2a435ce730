#include "daq/virtual/config.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace ferrobench::daq {

std::span<const std::pair<Clock, std::string_view>> enum_names(Clock) {
  static constexpr std::array<std::pair<Clock, std::string_view>, 2> names{
      {{Clock::real, "real"}, {Clock::fast, "fast"}}};
  return names;
}

VirtualConfig virtual_config_from_json(const nlohmann::json& json) {
  auto config = parse<VirtualConfig>(json.is_null() ? nlohmann::json::object() : json,
                                     ErrorCode::invalid_params, "the virtual device's configuration");
  const auto& c = config;
  std::vector<Problem> problems;
  protocols::check_past(c.past, "/past", problems);
  if (c.past.kind == protocols::PastKind::cycled)
    problems.push_back({.path = "/past/kind",
                        .message = "needs a program, and a device that is opened has none yet",
                        .given = "cycled",
                        .allowed = {"poled_plus", "poled_minus", "unpoled", "partly_poled", "visited"},
                        .hint = "name the levels that were visited"});
  if (!problems.empty())
    throw Error(ErrorCode::invalid_params, "the specimen's past is not valid", std::move(problems));
  if (!(c.field.enabled || c.charge.enabled || c.displacement.enabled || c.force.enabled))
    throw Error(
        ErrorCode::invalid_params, "the virtual device has no channel",
        Problem{.path = "/field/enabled", .given = false, .allowed = true, .hint = "enable at least one"});
  return config;
}

model::Model model_of(const VirtualConfig& config) {
  if (config.model.is_string()) return model::library_model(config.model.get<std::string>());
  return model::model_from_json(config.model);
}

namespace {

// What each channel can come to between +- field, everything switched one way or the other
// (4.1-4.4, 4.16, 4.17).
struct Reach {
  double charge, displacement, force;
};

Reach reach(const model::Model& model, double field) {
  const auto& m = model.material;
  const auto& a = model.actuator;
  const double stress = std::abs(model.load.prestress);
  const double permittivity = std::max(m.permittivity_180, m.permittivity_90);
  const double polarization =
      m.remanent_polarization + permittivity * field + std::abs(m.piezoelectric_180) * stress;
  const double strain = std::abs(m.remanent_strain_90) + std::abs(m.piezoelectric_180) * field +
                        std::abs(m.compliance_90 - m.compliance_180) * stress;
  const double displacement = strain * a.length;
  return {.charge = static_cast<double>(a.layer_count) * a.area * polarization,
          .displacement = displacement,
          .force = stress * a.area + model.load.spring_stiffness * displacement};
}

Sensor sensor(const ChannelConfig& config, double reach, double smallest) {
  // A quarter more for sensor errors, noise and effects of the catalogue.
  const double range = config.range.value_or(std::max(1.25 * reach, smallest));
  return {.range = range,
          .noise = config.noise.value_or(5e-5 * range),
          .gain = config.gain,
          .offset = config.offset};
}

}  // namespace

std::array<Sensor, 5> sensors_of(const VirtualConfig& config, const model::Model& model) {
  const auto r = reach(model, config.field_range);
  // A free specimen pulls on nothing, but its load cell is there: 10 N is a small one.
  return {Sensor{}, sensor(config.field, config.field_range, 0), sensor(config.charge, r.charge, 1e-12),
          sensor(config.displacement, r.displacement, 1e-9), sensor(config.force, r.force, 10)};
}

}  // namespace ferrobench::daq
