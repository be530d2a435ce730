// Fits that know their answer: the measurement is a simulation with other parameters.
#include "model/inference/study/fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "recordings/tables/published.h"
#include "tests/model/measured.h"

namespace ferrobench::model {
namespace {

using recordings::Channel;

constexpr SimulationOptions simulation{.tolerance = 1e-4, .domains = 128, .shift = 0};
const Fidelity fidelity{.simulation = simulation};

Model specimen() {
  auto m = library_model("soft-pzt");
  m.material.relaxation_time = 1e-3;
  return m;
}

FitOptions freeing(const Model& m, const std::vector<std::string>& paths) {
  FitOptions options;
  for (const auto& path : paths) options.free.push_back(free_parameter(m, path));
  options.starts = 1;
  options.simulation = simulation;
  return options;
}

std::unique_ptr<ResidualModel> recorded(recordings::Recording r) {
  std::vector<recordings::Recording> all;
  all.push_back(std::move(r));
  return recording_residuals(std::move(all));
}

Model moved(const Model& m, const std::string& path, double factor) {
  return with_parameters(m, {{path, factor * get_parameter(m, path)}});
}

class Fit : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Recovers, Fit,
                         testing::Values("material.remanent_polarization", "material.remanent_strain_90",
                                         "material.permittivity_180", "material.piezoelectric_180",
                                         "material.barrier", "material.activation_volume",
                                         "polycrystal.barrier_log_std", "polycrystal.interaction_field_std",
                                         "polycrystal.interaction_stress_std"),
                         [](const auto& i) {
                           std::string name = i.param;
                           std::replace(name.begin(), name.end(), '.', '_');
                           return name;
                         });

TEST_P(Fit, AParameterMovedByATenth) {
  const auto truth = specimen();
  const auto target = recorded(measured_on(truth, loop(), simulation));
  const auto start = moved(truth, GetParam(), 1.1);
  const auto result = fit(start, *target, freeing(truth, {GetParam()}));
  const double wanted = get_parameter(truth, GetParam());
  EXPECT_NEAR(get_parameter(result.model, GetParam()), wanted, 2e-3 * std::abs(wanted));
  EXPECT_LT(result.cost_after, 1e-3 * result.cost_before);
  ASSERT_EQ(result.parameters.size(), 1u);
  EXPECT_DOUBLE_EQ(result.parameters[0].from, get_parameter(start, GetParam()));
  EXPECT_DOUBLE_EQ(result.parameters[0].to, get_parameter(result.model, GetParam()));
  EXPECT_FALSE(result.parameters[0].at_bound);
}

TEST(FitOfSeveral, RecoversThemAll) {
  const auto truth = specimen();
  const std::vector<std::string> paths{"material.remanent_polarization", "material.piezoelectric_180",
                                       "material.barrier", "polycrystal.interaction_field_std"};
  auto start = truth;
  for (std::size_t i = 0; i < paths.size(); ++i) start = moved(start, paths[i], i % 2 == 0 ? 1.1 : 0.9);
  const auto result = fit(start, *recorded(measured_on(truth, loop(), simulation)), freeing(truth, paths));
  for (const auto& path : paths) {
    const double wanted = get_parameter(truth, path);
    EXPECT_NEAR(get_parameter(result.model, path), wanted, 0.01 * wanted) << path;
  }
}

// The truth lies outside the range: the fit stops at its end and says so.
TEST(FitBounds, AreKept) {
  const auto truth = specimen();
  auto options = freeing(truth, {"material.piezoelectric_180"});
  options.free[0].low = 2e-10;
  options.free[0].high = 4e-10;
  const auto result = fit(moved(truth, "material.piezoelectric_180", 0.6),
                          *recorded(measured_on(truth, loop(), simulation)), options);
  const double found = result.model.material.piezoelectric_180;
  EXPECT_LE(found, 4e-10);
  EXPECT_GT(found, 3.95e-10);
  EXPECT_TRUE(result.parameters[0].at_bound);
}

// Where the search's own scale passes zero, steps must not shrink with it.
TEST(FitBounds, MayHaveTheStartInTheirMiddle) {
  const auto truth = specimen();
  auto options = freeing(truth, {"material.barrier"});
  const auto start = moved(truth, "material.barrier", 1.1);
  options.free[0].low = start.material.barrier / 5;
  options.free[0].high = start.material.barrier * 5;
  const auto result = fit(start, *recorded(measured_on(truth, loop(), simulation)), options);
  EXPECT_NEAR(result.model.material.barrier, truth.material.barrier, 2e-3 * truth.material.barrier);
}

TEST(FitRanges, HoldTheShippedModels) {
  for (const auto& name : model_library_names()) {
    const auto m = library_model(name);
    for (const auto& p : default_free_parameters(m)) {
      const double value = get_parameter(m, p.path);
      EXPECT_LE(p.low, value) << name << " " << p.path;
      EXPECT_GE(p.high, value) << name << " " << p.path;
      EXPECT_NEAR(from_unit(p, to_unit(p, value)), value, 1e-9 * std::abs(value)) << name << " " << p.path;
    }
  }
}

TEST(FitRanges, GoAlongWithTheFieldThatASpecimenWasDrivenTo) {
  const auto m = library_model("soft-pzt-bulk");
  const auto times = [&](double largest_field, std::string_view path) {
    return free_parameter(m, path, {.largest_field = largest_field}).high / free_parameter(m, path).high;
  };
  // As far as bulk specimens are driven they are the same.
  for (const auto* path : {"material.barrier", "polycrystal.bias_field", "polycrystal.interaction_field_std",
                           "effects.mean_field_interaction.coefficient"}) {
    EXPECT_EQ(times(2e6, path), 1) << path;
    EXPECT_NEAR(times(15e6, path), 2 * times(7.5e6, path), 1e-12) << path;
    EXPECT_GT(times(7.5e6, path), 2) << path;
  }
  EXPECT_EQ(times(15e6, "material.remanent_polarization"), 1);
  EXPECT_EQ(times(15e6, "material.permittivity_180"), 1);
  // A film of PZT has its permittivity, one of AlN, at ten times the field, 16 and more times that of vacuum.
  const auto low = [&](double largest_field) {
    return free_parameter(m, "material.permittivity_180",
                          {.largest_field = largest_field, .largest_polarization = 0.4})
        .low;
  };
  EXPECT_EQ(low(2e6), free_parameter(m, "material.permittivity_180").low);
  EXPECT_EQ(low(3e7), free_parameter(m, "material.permittivity_180").low);
  EXPECT_LT(low(3e8), 1.5e-10);
  // Whatever the field, what a fit ends at is a specimen that switches.
  auto highest = m;
  highest.material.barrier = free_parameter(m, "material.barrier", {.largest_field = 1e9}).high;
  EXPECT_TRUE(switches(highest));
}

TEST(FitRanges, HoldThePolarizationThatTheChargeShows) {
  const auto m = library_model("soft-pzt");
  const auto highest = [&](double times) {
    auto r = measured_on(m, loop(), simulation);
    auto charge = r.at(Channel::charge);
    for (double& q : charge) q *= times;
    r.set(Channel::charge) = charge;
    const auto data = prepare(std::move(r));
    return free_parameter(m, "material.remanent_polarization", evidence_of({&data, 1})).high;
  };
  const double usual = free_parameter(m, "material.remanent_polarization").high;
  EXPECT_EQ(highest(1), usual);
  EXPECT_GT(highest(4), 4 * m.material.remanent_polarization);
  EXPECT_LT(highest(4), 8 * m.material.remanent_polarization);
}

TEST(FreeParameters, AreNoneOfTheStrainWhereNoneShows) {
  const auto m = library_model("soft-pzt");
  const auto frees = [&](const RecordingData& data, std::string_view path) {
    const auto free = default_free_parameters(m, evidence_of({&data, 1}));
    return std::ranges::find(free, path, &FreeParameter::path) != free.end();
  };
  auto data = prepare(measured_on(m, loop(), simulation));
  data.header.load = {};
  EXPECT_TRUE(frees(data, "material.remanent_strain_90"));
  std::erase_if(data.columns, [](const auto& c) { return c.channel != recordings::Channel::charge; });
  EXPECT_FALSE(frees(data, "material.remanent_strain_90"));
  EXPECT_FALSE(frees(data, "material.compliance_180"));
  EXPECT_TRUE(frees(data, "material.permittivity_90"));
  EXPECT_TRUE(frees(data, "polycrystal.interaction_stress_std"));
  // Under a spring the charge depends on how far the specimen goes.
  data.header.load.spring_stiffness = 1e7;
  EXPECT_TRUE(frees(data, "material.remanent_strain_90"));
}

constexpr double gap = std::numeric_limits<double>::quiet_NaN();

std::vector<double> residuals_of(const ResidualModel& target, const Model& m) {
  std::vector<double> out(target.size());
  EXPECT_EQ(target.evaluate(m, fidelity, out), Solved::yes);
  return out;
}

// The first and last samples, and the highest, are not needed for the others to count as much as they did.
TEST(FitTargets, OfARecordingPassOverGaps) {
  const auto truth = specimen(), other = moved(truth, "material.barrier", 1.1);
  const auto whole = measured_on(truth, loop(), simulation);
  const auto& x = whole.at(Channel::displacement);
  const auto before = recorded(whole)->summary(other, fidelity);
  ASSERT_GT(before[1].second, 1);
  auto r = whole;
  auto gapped = x;
  gapped.front() = gapped[7] = gapped.back() = gap;
  r.set(Channel::displacement) = gapped;
  const auto target = recorded(r);
  ASSERT_EQ(target->size(), 3 * x.size() - 3);
  EXPECT_THAT(residuals_of(*target, truth), testing::Each(testing::DoubleNear(0, 1e-9)));
  const auto after = target->summary(other, fidelity);
  ASSERT_EQ(after.size(), 3u);
  EXPECT_EQ(after[0], before[0]);
  EXPECT_NEAR(after[1].second, before[1].second, 0.02 * before[1].second);
  EXPECT_EQ(after[2], before[2]);
}

// A sensor's zero is unknown: where each channel begins makes no difference, be it absolute or not.
TEST(FitTargets, OfARecordingDoNotCountASensorsZero) {
  const auto truth = specimen(), other = moved(truth, "material.barrier", 1.1);
  const auto whole = measured_on(truth, loop(), simulation);
  for (const auto channel : {Channel::charge, Channel::displacement, Channel::force}) {
    auto r = whole;
    auto values = r.at(channel);
    const auto [low, high] = std::ranges::minmax(values);
    for (auto& v : values) v += 3 * (high - low);
    r.set(channel) = values;
    EXPECT_THAT(residuals_of(*recorded(r), truth), testing::Each(testing::DoubleNear(0, 1e-9)));
    const auto before = recorded(whole)->summary(other, fidelity),
               after = recorded(r)->summary(other, fidelity);
    for (std::size_t i = 0; i < before.size(); ++i)
      EXPECT_NEAR(after[i].second, before[i].second, 1e-9) << before[i].first;
  }
}

TEST(FitTargets, OfARecordingSayWhichChannelsSayNothing) {
  const auto truth = specimen();
  auto r = measured_on(truth, loop(), simulation);
  r.header.title = "loop";
  r.set(Channel::charge).assign(r.size(), gap);
  r.set(Channel::force).assign(r.size(), 12.5);
  const auto target = recorded(r);
  EXPECT_EQ(target->size(), r.size());
  EXPECT_THAT(target->unused(),
              testing::ElementsAre("loop, charge has no finite value", "loop, force never changes"));
  r.set(Channel::displacement).assign(r.size(), gap);
  try {
    recorded(r);
    FAIL() << "there is nothing to fit to";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::bad_recording);
    EXPECT_THAT(e.what(), testing::HasSubstr("loop, displacement has no finite value"));
  }
}

// A fit finds its way through a recording that begins and ends in a gap.
TEST(FitTargets, OfARecordingAreWorthFollowingThroughGaps) {
  const auto truth = specimen();
  auto r = measured_on(truth, loop(), simulation);
  auto x = r.at(Channel::displacement);
  x.front() = x.back() = gap;
  r.channels = {r.at(Channel::command), {}, {}, x, {}};
  const auto start = moved(truth, "material.piezoelectric_180", 1.1);
  const auto result = fit(start, *recorded(r), freeing(truth, {"material.piezoelectric_180"}));
  EXPECT_NEAR(result.model.material.piezoelectric_180, truth.material.piezoelectric_180,
              2e-3 * truth.material.piezoelectric_180);
}

std::vector<double> centred(std::vector<double> values) {
  double mean = 0;
  for (const double v : values) mean += v / static_cast<double>(values.size());
  for (double& v : values) v -= mean;
  return values;
}

TEST(FitTargets, OfARecordingArePercentOfTheRange) {
  const auto truth = specimen();
  const auto r = measured_on(truth, loop(), simulation);
  const auto other = moved(truth, "material.barrier", 1.1);
  const auto misfits = recorded(r)->summary(other, fidelity);
  ASSERT_EQ(misfits.size(), 3u);  // charge, displacement, force
  const auto t = simulate(other, r.time, r.at(Channel::command), simulation);
  EXPECT_NEAR(misfits[0].second, 100 * apart(centred(r.at(Channel::charge)), centred(t.charge)), 1e-6);
  EXPECT_NEAR(misfits[1].second, 100 * apart(centred(r.at(Channel::displacement)), centred(t.displacement)),
              1e-6);
}

constexpr SimulationOptions coarse{.tolerance = 1e-3, .domains = 16, .shift = 0};  // long programs

Model specimen_of(const std::string& table) {
  return library_model(recordings::published_table(table).description.specimen);
}

TEST(FitTargets, OfATableAreTheLogarithmsOfItsCells) {
  const auto m = specimen_of("3.13");
  const auto target = table_residuals({"3.13"});
  const auto comparison = simulate_table(m, "3.13", coarse);
  ASSERT_EQ(target->size(), comparison.cells.size());
  std::vector<double> residuals(target->size());
  target->evaluate(m, {.simulation = coarse}, residuals);
  double squares = 0;
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    const auto& cell = comparison.cells[i];
    ASSERT_TRUE(cell.measured) << i;
    EXPECT_NEAR(residuals[i] * cell.published.uncertainty,
                std::log(*cell.measured / cell.published.published), 1e-3)
        << i;
    squares += std::pow(std::log(*cell.measured / cell.published.published), 2);
  }
  const auto summary = target->summary(m, {.simulation = coarse});
  ASSERT_EQ(summary.size(), 1u);
  EXPECT_NEAR(summary[0].second, std::sqrt(squares / static_cast<double>(residuals.size())), 1e-9);
}

TEST(FitTargets, OfATableAreWorthFollowing) {
  const auto m = specimen_of("3.13");
  auto options = freeing(m, {"material.piezoelectric_180"});
  options.iterations = 4;
  options.simulation = coarse;
  const auto target = table_residuals({"3.13"});
  const auto result = fit(moved(m, "material.piezoelectric_180", 1.2), *target, options);
  std::vector<double> shipped(target->size());
  target->evaluate(m, {.simulation = coarse}, shipped);
  double cost = 0;
  for (const double r : shipped) cost += r * r;
  EXPECT_LT(result.cost_after, cost);
  EXPECT_LT(result.cost_after, 0.2 * result.cost_before);
}

TEST(FitProgressCall, EndsTheFitWithTheBestSoFar) {
  const auto truth = specimen();
  auto options = freeing(truth, {"material.barrier"});
  options.starts = 3;
  int calls = 0;
  options.progress = [&](const FitProgress& p) {
    EXPECT_EQ(p.stage, "searching");
    EXPECT_LE(p.fraction, 1);
    return ++calls < 2;
  };
  const auto result =
      fit(moved(truth, "material.barrier", 1.1), *recorded(measured_on(truth, loop(), simulation)), options);
  EXPECT_TRUE(result.stopped);
  EXPECT_EQ(calls, 2);
  EXPECT_LE(result.cost_after, result.cost_before);
}

TEST(FitErrors, SayWhatIsWrong) {
  const auto m = specimen();
  try {
    free_parameter(m, "material.barier");
    FAIL() << "there is no such parameter";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::invalid_params);
    EXPECT_THAT(e.what(), testing::HasSubstr("material.barrier"));
  }
  EXPECT_THROW(with_parameters(m, {{"material.temperature", -3}}), Error);
  EXPECT_THROW(fit(m, *recorded(measured_on(m, rest(), simulation)), freeing(m, {})), Error);
  EXPECT_THROW(table_residuals({}), Error);
  EXPECT_THROW(table_residuals({"9.99"}), Error);
  EXPECT_THROW(recorded(recordings::Recording{}), Error);
}

}  // namespace
}  // namespace ferrobench::model
