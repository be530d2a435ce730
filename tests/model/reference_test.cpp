// The solution against an independent program's (reference/README.md), and the stated errors against true
// ones.
#include <gtest/gtest.h>

#include <filesystem>

#include "model/on_recording.h"
#include "recordings/file/reader.h"
#include "tests/model/random_models.h"

namespace ferrobench::model {
namespace {

using recordings::Channel;

std::vector<std::string> reference_names() {
  std::vector<std::string> names;
  for (const auto& file : std::filesystem::directory_iterator(MODEL_REFERENCE))
    if (file.path().extension() == ".h5") names.push_back(file.path().stem());
  std::sort(names.begin(), names.end());
  return names;
}

recordings::Recording reference(const std::string& name) {
  return recordings::read_recording(std::string(MODEL_REFERENCE) + "/" + name + ".h5");
}

TEST(Reference, IsAllThere) {
  EXPECT_EQ(reference_names().size(), 6u);
}

class EachReference : public testing::TestWithParam<std::string> {};

TEST_P(EachReference, IsGivenBack) {
  const auto recording = reference(GetParam());
  const auto model = model_from_json(recording.header.model);
  const auto ours = simulate_on(model, recording);
  const double allowed = model.polycrystal.method == PolycrystalMethod::none ? 5e-4 : 2e-3;
  for (const auto channel : {Channel::charge, Channel::displacement, Channel::force}) {
    const auto& theirs = recording.at(channel);
    const auto [low, high] = std::minmax_element(theirs.begin(), theirs.end());
    if (*high - *low < 1e-9) continue;  // no spring: the force does not move
    const double error = apart(theirs, channel_of(ours, channel));
    RecordProperty(std::string(channel_name(channel)), std::to_string(error));
    EXPECT_LT(error, allowed) << channel_name(channel);
  }
}

INSTANTIATE_TEST_SUITE_P(All, EachReference, testing::ValuesIn(reference_names()),
                         [](const auto& i) { return i.param; });

// The largest of P's and strain's true error, rms, as a share of what switches.
double true_error(const Model& m, const Trajectory& a, const Trajectory& exact) {
  const double charge =
      2 * m.material.remanent_polarization * m.actuator.area * static_cast<double>(m.actuator.layer_count);
  const double stroke = -m.material.remanent_strain_90 * m.actuator.length;
  double q = 0, x = 0;
  for (std::size_t i = 0; i < a.charge.size(); ++i) {
    q += std::pow((a.charge[i] - exact.charge[i]) / charge, 2);
    x += std::pow((a.displacement[i] - exact.displacement[i]) / stroke, 2);
  }
  return std::sqrt(std::max(q, x) / static_cast<double>(a.charge.size()));
}

TEST(StatedError, OfTimeIsNearTheTrueOne) {
  for (const auto& name : reference_names()) {
    const auto recording = reference(name);
    const auto model = model_from_json(recording.header.model);
    SimulationOptions options{.tolerance = 1e-4, .domains = 256, .shift = 0};
    const auto plain = simulate_on(model, recording, options);
    options.tolerance = 1e-7;
    const double error = true_error(model, plain, simulate_on(model, recording, options));
    EXPECT_GT(plain.time_error, error / 3) << name;
    EXPECT_LT(plain.time_error, error * 30) << name;
    EXPECT_LT(error, 2e-4) << name;
  }
}

// Among the draws are models whose domains outlast their barriers (tau long against the field's rise) and
// those that switch long before.
TEST(StatedError, OfTimeIsNearTheTrueOneForRandomModels) {
  for (const unsigned seed : {11u, 13u, 14u}) {
    Draw draw(seed);
    for (int i = 0; i < 20; ++i) {
      const auto model = draw.model();
      const auto program = draw.program();
      const auto at = [&](double tolerance) {
        return simulate(model, program.time, program.field,
                        {.tolerance = tolerance, .domains = 256, .shift = 0});
      };
      const auto plain = at(1e-4);
      const double error = true_error(model, plain, at(2e-6));
      EXPECT_GT(plain.time_error, error / 6) << "seed " << seed << " draw " << i;
      EXPECT_LT(plain.time_error, error * 6) << "seed " << seed << " draw " << i;
      EXPECT_LT(error, 4e-4) << "seed " << seed << " draw " << i;
    }
  }
}

TEST(StatedError, OfTheQuadratureIsNearTheTrueOne) {
  for (const std::string name : {"polycrystal_full_loops", "polycrystal_passive_layers"}) {
    const auto recording = reference(name);
    const auto model = model_from_json(recording.header.model);
    for (const int count : {128, 512}) {
      const auto few = simulate_on(model, recording, {.tolerance = 1e-4, .domains = count, .shift = 0}, true);
      const auto many = simulate_on(model, recording, {.tolerance = 1e-4, .domains = 30000, .shift = 0});
      const double error =
          std::max(apart(many.charge, few.charge), apart(many.displacement, few.displacement));
      EXPECT_GT(few.quadrature_error, error / 3) << name << " " << count;
      EXPECT_LT(few.quadrature_error, error * 30) << name << " " << count;
    }
  }
}

// In holds against a stiff spring, where few domains show most.
TEST(BelowNoise, HoldsForManyDomains) {
  auto model = library_model("soft-pzt");
  model.load = {.spring_stiffness = 5.9e6, .prestress = 2e6};
  std::vector<double> time{0}, field{1.5e6};
  const auto add = [&](double to, double seconds) {
    const double from = field.back(), begin = time.back();
    const int steps = static_cast<int>(std::ceil(seconds / 0.1));
    for (int i = 1; i <= steps; ++i) {
      time.push_back(begin + seconds * i / steps);
      field.push_back(std::lerp(from, to, static_cast<double>(i) / steps));
    }
  };
  for (const double level : {0.0, -0.45e6, -0.5e6, -0.55e6, -0.8e6, -1.5e6}) {
    add(level, (1.5e6 - level) / 1e5);
    add(level, 15);
    add(1.5e6, (1.5e6 - level) / 1e5);
    add(1.5e6, 5);
  }
  const auto play = [&](int domains) {
    auto options = below_noise;
    options.domains = domains;
    return simulate(model, time, field, options).displacement;
  };
  const auto exact = play(64000);
  EXPECT_LT(apart(exact, play(below_noise.domains)), 6e-5);
  EXPECT_GT(apart(exact, play(1000)), 6e-4);
}

// Where the default's domains do not bring 0.2 % the stated quadrature error has to say so.
TEST(Defaults, AreConvergedOrSayThatTheyAreNot) {
  Draw draw(11);
  int converged = 0;
  for (int i = 0; i < 20; ++i) {
    const auto model = draw.model();
    const auto program = draw.program();
    const auto change = [&](const Trajectory& a, const Trajectory& b) {
      return std::max(apart(a.charge, b.charge), apart(a.displacement, b.displacement));
    };
    const auto exact =
        simulate(model, program.time, program.field, {.tolerance = 1e-4, .domains = 20000, .shift = 0});
    const auto plain = simulate(model, program.time, program.field, {}, true);
    const auto finer =
        simulate(model, program.time, program.field, {.tolerance = 1e-4, .domains = 8000, .shift = 1});
    const double error = change(exact, plain);
    converged += error < 2e-3;
    EXPECT_GT(plain.quadrature_error, error / 4) << "draw " << i << "\n" << to_json(model).dump(1);
    EXPECT_LT(change(exact, finer), 2e-3) << "draw " << i;
  }
  EXPECT_GE(converged, 19);
}

}  // namespace
}  // namespace ferrobench::model
