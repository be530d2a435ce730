// What a virtual bench consists of: the specimen (a model), the amplifier's range, the sensors, the clock.
#pragma once

#include <optional>
#include <span>

#include "base/fields.h"
#include "daq/virtual/converter.h"
#include "model/simulator.h"

namespace ferrobench::daq {

// real: rows come at their rate. fast: as fast as they can be computed. The counts are the same.
enum class Clock { real, fast };
std::span<const std::pair<Clock, std::string_view>> enum_names(Clock);

struct ChannelConfig {
  bool enabled = true;
  std::optional<double>
      range;  // SI full scale; absent: wide enough for whatever the model can do in field_range
  std::optional<double> noise;  // SI; absent: 5e-5 of the range, 1.6 counts, what 16-bit converters show
  double gain = 1;
  double offset = 0;  // SI
};

struct VirtualConfig {
  nlohmann::json model = "soft-pzt";  // a shipped model's name, or a model
  std::int64_t seed = 1;
  Clock clock = Clock::real;
  protocols::Past past{protocols::PastKind::poled_plus};  // of the specimen when the device is opened
  double field_range = 2e6;                               // V/m; +-200 V on layers of 100 um
  double tolerance = model::below_noise.tolerance;
  std::int64_t domains = model::below_noise.domains;  // 0: as many as the tolerance asks for
  ChannelConfig field, charge, displacement, force;
};

template <class Visitor>
void describe(Visitor& visit, ChannelConfig& c) {
  visit("enabled", c.enabled, {.doc = "whether the channel is sampled"});
  visit("range", c.range,
        {.min = 0, .exclusive_min = true, .doc = "full scale in SI; absent: from the model"});
  visit("noise", c.noise, {.min = 0, .doc = "standard deviation in SI; absent: 5e-5 of the range"});
  visit("gain", c.gain, {.min = -10, .max = 10, .doc = "of the sensor against a perfect one"});
  visit("offset", c.offset, {.doc = "of the sensor, in SI"});
}

template <class Visitor>
void describe(Visitor& visit, VirtualConfig& c) {
  visit("model", c.model, {.doc = "name of a shipped model, or a model as JSON"});
  visit("seed", c.seed, {.min = 0, .doc = "of the noise: same seed, same bytes"});
  visit("clock", c.clock, {.doc = "real: rows come at their rate; fast: as fast as they can be computed"});
  visit("past", c.past,
        {.doc = "what the specimen has been through when the device is opened; cycled is none here, as the "
                "program is not known yet"});
  visit("field_range", c.field_range,
        {.unit = "V/m", .min = 0, .max = 1e9, .exclusive_min = true, .doc = "the amplifier reaches +- this"});
  visit("tolerance", c.tolerance,
        {.min = 1e-9, .max = 0.1, .doc = "of the model, share of its switching range"});
  visit("domains", c.domains,
        {.min = 0, .max = 1e6, .doc = "of the polycrystal; 0: as many as the tolerance asks for"});
  visit("field", c.field, {.unit = "V/m"});
  visit("charge", c.charge, {.unit = "C"});
  visit("displacement", c.displacement, {.unit = "m"});
  visit("force", c.force, {.unit = "N"});
}

// Throws Error(invalid_params).
VirtualConfig virtual_config_from_json(const nlohmann::json& json);
// The model that `config.model` names or is. Throws Error(not_found | bad_model).
model::Model model_of(const VirtualConfig& config);
// The sensors as configured, with what is absent filled in, by Channel (command stays as it is).
std::array<Sensor, 5> sensors_of(const VirtualConfig& config, const model::Model& model);

}  // namespace ferrobench::daq
