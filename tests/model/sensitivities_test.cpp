// Forward sensitivities against central differences, and values with and without them.
#include "model/sensitivities.h"

#include <gtest/gtest.h>

#include "model/gradient_check.h"
#include "model/inference/parameters/parameters.h"
#include "model/physics/wells.h"
#include "tests/model/empirical_reference.h"
#include "tests/model/random_models.h"

namespace ferrobench::model {
namespace {

// A loop through both wells' ends and a hold, with outputs that do not fall on the steps.
const std::vector<double> knot_time{0, 0.1, 0.3, 0.4, 0.55}, knot_field{0, -1.6e6, 1.7e6, 2e5, 2e5};

std::vector<double> times() {
  std::vector<double> out;
  for (int i = 0; i <= 97; ++i) out.push_back(0.55 * i / 97);
  return out;
}

enum class Specimen { crystal, sprung_crystal, polycrystal, sprung_polycrystal };

Model specimen(Specimen kind) {
  Model m = crystal();
  if (kind == Specimen::crystal || kind == Specimen::polycrystal) m.load.spring_stiffness = 0;
  if (kind == Specimen::polycrystal || kind == Specimen::sprung_polycrystal) {
    m.polycrystal.method = PolycrystalMethod::distribution;
    m.polycrystal.barrier_log_std = 0.3;
    m.polycrystal.interaction_field_std = 1e5;
    m.polycrystal.interaction_stress_std = 5e6;
  }
  return m;
}

// Where slopes and differences must agree, as a share of the slope: 1e-5. Slopes that move a channel by less
// than 1e-4 of its range are small against what rounding makes of differences.
void expect_agreement(const Model& model, const std::vector<CheckedParameter>& parameters, int domains) {
  const auto t = times();
  for (const auto& c : check_gradient(model, parameters, knot_time, knot_field, t,
                                      {.simulation = {.tolerance = 1e-4, .domains = domains}}))
    if (c.largest > 1e-10) {
      EXPECT_LT(c.error, c.largest > 1e-4 ? 1e-5 : 2e-4)
          << c.parameter << " in " << c.channel << ", largest " << c.largest;
    }
}

std::vector<CheckedParameter> parameters_of(const Model& model) {
  std::vector<CheckedParameter> out;
  for (const auto& path : parameter_paths(model)) {
    const double value = get_parameter(model, path);
    // Not those at zero whose other side is none: spreads, to which all is even, and a stress-free specimen.
    if (value != 0)
      out.push_back({path});
    else if (path == "polycrystal.bias_field")
      out.push_back({path, 1e5});
  }
  return out;
}

// Values at which an effect shows in these programs: the middle of its range, but for limits and masses.
Model with_effect(const Model& m, const Effect& effect) {
  Parameters values;
  for (const auto& p : effect.parameters) values.emplace_back(std::string(p.name), std::sqrt(p.low * p.high));
  if (effect.table) values = empirical_values(std::string(effect.id), values[0].second, 0.07);
  if (effect.id == "displacement_clipping") values[0].second = 1e-5;
  if (effect.id == "amplifier_slew_limit") values[0].second = 1.2e7;
  if (effect.id == "contact_gap") values[0].second = 3e-6;
  if (effect.id == "stage_inertia") values[0].second = 1;
  return with(m, std::string(effect.id), values);
}

class EachSpecimen : public testing::TestWithParam<std::tuple<Specimen, BarrierLaw>> {
 protected:
  static Model model() {
    auto m = specimen(std::get<0>(GetParam()));
    m.material.barrier_law = std::get<1>(GetParam());
    return m;
  }
};

TEST_P(EachSpecimen, SlopesByEveryParameterAreThoseOfDifferences) {
  auto m = model();
  expect_agreement(m, parameters_of(m), 64);
  m.actuator.passive_stiffness = 5e7;
  expect_agreement(m, {{"actuator.passive_stiffness"}, {"material.barrier"}}, 64);
}

INSTANTIATE_TEST_SUITE_P(
    Slopes, EachSpecimen,
    testing::Combine(testing::Values(Specimen::crystal, Specimen::sprung_crystal, Specimen::polycrystal,
                                     Specimen::sprung_polycrystal),
                     testing::Values(BarrierLaw::equal_curvature, BarrierLaw::unequal_curvature)));

// Wells that exchange many times in a step, a few times, and never.
TEST(FastWells, SlopesAreThoseOfDifferences) {
  auto m = specimen(Specimen::sprung_polycrystal);
  m.material.relaxation_time = 1e-9;
  m.material.barrier = 15 * boltzmann * m.material.temperature / m.material.activation_volume;
  for (const std::string effect : {"", "empirical_asymmetry", "empirical_direct"})
    expect_agreement(effect.empty() ? m : with_effect(m, find_effect(effect)), parameters_of(m), 64);
}

class EachEffect : public testing::TestWithParam<std::string> {};

TEST_P(EachEffect, SlopesAreThoseOfDifferences) {
  const auto& effect = find_effect(GetParam());
  std::vector<CheckedParameter> parameters{{"material.barrier"}, {"material.piezoelectric_180"}};
  for (const auto& p : effect.parameters)
    parameters.push_back({"effects." + GetParam() + "." + std::string(p.name)});
  for (const auto kind :
       {Specimen::crystal, Specimen::sprung_crystal, Specimen::polycrystal, Specimen::sprung_polycrystal}) {
    SCOPED_TRACE(static_cast<int>(kind));
    // Where a domain's well ends just at a step's end, its ln(rate) jumps by the bend, and with drag no loads
    // may agree there to the last digit: another lattice then.
    const int domains = effect.id == "domain_wall_drag" ? 120 : 40;
    expect_agreement(with_effect(specimen(kind), effect), parameters, domains);
  }
}

TEST_P(EachEffect, ValuesAreTheSameBitsWithSlopes) {
  const auto m = with_effect(specimen(Specimen::sprung_polycrystal), find_effect(GetParam()));
  const auto t = times();
  const auto paths = parameter_paths(m);
  const std::vector<std::string> wanted{
      "material.barrier",
      "effects." + GetParam() + "." + std::string(find_effect(GetParam()).parameters[0].name)};
  std::vector<double> plain(t.size()), beside(t.size()), slopes(t.size() * wanted.size());
  ChannelSpans out;
  out.displacement = plain;
  const SimulationOptions options{.domains = 40};
  const auto steps = simulate_at(m, knot_time, knot_field, t, out, options).steps;
  out.displacement = beside;
  SlopeSpans wanted_slopes;
  wanted_slopes.displacement = slopes;
  EXPECT_EQ(simulate_with_slopes(m, wanted, knot_time, knot_field, t, out, wanted_slopes, options).steps,
            steps);
  EXPECT_EQ(plain, beside);
}

std::vector<std::string> effect_ids() {
  std::vector<std::string> ids;
  for (const auto& effect : effect_catalogue()) ids.emplace_back(effect.id);
  return ids;
}
INSTANTIATE_TEST_SUITE_P(Effects, EachEffect, testing::ValuesIn(effect_ids()),
                         [](const auto& i) { return i.param; });

// Where the field that the rates see is solved for, and where that across the material is as well.
TEST(Slopes, OfAnEmpiricalRateBesideDragAndResistance) {
  std::vector<CheckedParameter> parameters{{"material.barrier"}};
  for (const auto& p : find_effect("empirical_rate").parameters)
    parameters.push_back({"effects.empirical_rate." + std::string(p.name)});
  const auto rate = with(specimen(Specimen::sprung_polycrystal), "empirical_rate",
                         empirical_values("empirical_rate", 5e4, 0.07));
  for (const auto* id : {"domain_wall_drag", "source_resistance"}) {
    SCOPED_TRACE(id);
    parameters.push_back({std::string("effects.") + id + ".coefficient"});
    expect_agreement(with(rate, id, {{"coefficient", 1e4}}), parameters, 120);
    parameters.pop_back();
  }
}

// A fit begins with weights of zero, where the values need no coupling that the slopes need.
TEST(Slopes, ByTheWeightsOfAnEmpiricalTermAtZero) {
  for (const auto* id : {"empirical_strain", "empirical_polarization", "empirical_rate", "empirical_drive",
                         "empirical_spring"}) {
    SCOPED_TRACE(id);
    std::vector<CheckedParameter> parameters;
    auto values = empirical_values(id, find_effect(id).parameters[0].high / 10, 0.07);
    for (auto& [name, value] : values)
      if (std::isdigit(static_cast<unsigned char>(name.back())) != 0 || name.starts_with("lag_")) {
        value = 0;
        parameters.push_back({std::string("effects.") + id + "." + name, 1});
      }
    for (const auto kind : {Specimen::crystal, Specimen::sprung_polycrystal})
      expect_agreement(with(specimen(kind), id, values), parameters, 40);
  }
}

class EachShippedModel : public testing::TestWithParam<std::string> {};

TEST_P(EachShippedModel, SlopesAreThoseOfDifferences) {
  const auto m = library_model(GetParam());
  expect_agreement(m, parameters_of(m), 64);
}

INSTANTIATE_TEST_SUITE_P(Library, EachShippedModel, testing::ValuesIn(model_library_names()),
                         [](const auto& i) {
                           auto name = i.param;
                           for (auto& c : name)
                             if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
                           return name;
                         });

// The plan apart: a plain simulation so fine that its own steps hardly matter.
TEST(Slopes, AreThoseOfAFinePlainSimulation) {
  const auto m = specimen(Specimen::sprung_crystal);
  const auto t = times();
  const SimulationOptions fine{.tolerance = 1e-7};
  const std::vector<std::string> path{"material.relaxation_time"};
  const auto displacement = [&](double factor) {
    std::vector<double> out(t.size());
    ChannelSpans spans;
    spans.displacement = out;
    auto moved = m;
    moved.material.relaxation_time *= factor;
    simulate_at(moved, knot_time, knot_field, t, spans, fine);
    return out;
  };
  std::vector<double> slopes(t.size());
  SlopeSpans spans;
  spans.displacement = slopes;
  simulate_with_slopes(m, path, knot_time, knot_field, t, {}, spans, fine);
  const auto up = displacement(1.003), down = displacement(1 / 1.003);
  double error = 0, size = 0;
  for (std::size_t i = 0; i < t.size(); ++i) {
    const double difference = (up[i] - down[i]) / (2 * std::log(1.003));
    const double slope = slopes[i] * m.material.relaxation_time;
    error += (difference - slope) * (difference - slope);
    size += slope * slope;
  }
  EXPECT_LT(std::sqrt(error / size), 2e-3);
}

TEST(Slopes, OfASpreadOfZeroAreZero) {
  auto m = specimen(Specimen::polycrystal);
  m.polycrystal.interaction_field_std = 0;
  const auto t = times();
  std::vector<double> slopes(t.size(), 1);
  SlopeSpans spans;
  spans.charge = slopes;
  const std::vector<std::string> path{"polycrystal.interaction_field_std"};
  simulate_with_slopes(m, path, knot_time, knot_field, t, {}, spans, {.domains = 40});
  for (const double slope : slopes) EXPECT_EQ(slope, 0);
}

TEST(Slopes, ByWhatIsNoNumberOfTheModelAreRefused) {
  const std::vector<std::string> path{"material.barier"};
  EXPECT_THROW(simulate_with_slopes(crystal(), path, knot_time, knot_field, times(), {}, {}), Error);
}

// The drive's own directions: a level and an inner knot's time, one of them behind an amplifier that lags.
TEST(Slopes, ByTheDriveAreThoseOfItsKnots) {
  auto model = specimen(Specimen::sprung_polycrystal);
  for (const bool lags : {false, true}) {
    if (lags) model.effects.push_back({"amplifier_lag", {{"time_constant", 2e-3}}});
    const auto t = times();
    const SimulationOptions options{.tolerance = 1e-7, .domains = 500};
    const auto simulated = [&](double level, double moved) {
      auto time = knot_time;
      auto field = knot_field;
      field[1] += level;
      time[2] += moved;
      std::vector<double> out(t.size());
      ChannelSpans spans;
      spans.displacement = out;
      simulate_at(model, time, field, t, spans, options);
      return out;
    };
    constexpr double level = 2e3, moved = 1e-4;
    std::vector<double> by_time(2 * knot_time.size(), 0.0), by_field(2 * knot_time.size(), 0.0);
    by_field[2 * 1 + 0] = 1;
    by_time[2 * 2 + 1] = 1;
    const std::vector<std::string> parameter{"material.barrier"};
    std::vector<double> values(t.size()), slopes(3 * t.size());
    ChannelSpans spans;
    spans.displacement = values;
    SlopeSpans slope_spans;
    slope_spans.displacement = slopes;
    simulate_with_slopes(model, parameter, knot_time, knot_field, t, spans, slope_spans, options,
                         {.count = 2, .time = by_time, .field = by_field});
    for (const std::size_t k : {1, 2}) {
      const auto up = k == 1 ? simulated(level, 0) : simulated(0, moved),
                 down = k == 1 ? simulated(-level, 0) : simulated(0, -moved);
      double off = 0, all = 0;
      for (std::size_t i = 0; i < t.size(); ++i) {
        const double difference = (up[i] - down[i]) / (2 * (k == 1 ? level : moved));
        off += std::pow(slopes[3 * i + k] - difference, 2);
        all += difference * difference;
      }
      ASSERT_GT(all, 0);
      EXPECT_LT(std::sqrt(off / all), 0.01) << k << (lags ? " behind a lag" : "");
    }
  }
}

TEST(Slopes, ByTheDriveMustBeOfAllItsKnots) {
  const auto model = specimen(Specimen::polycrystal);
  const std::vector<double> short_field(knot_time.size() - 1, 1.0);
  EXPECT_THROW(simulate_with_slopes(model, {}, knot_time, knot_field, times(), {}, {}, {},
                                    {.count = 1, .time = {}, .field = short_field}),
               Error);
}

}  // namespace
}  // namespace ferrobench::model
