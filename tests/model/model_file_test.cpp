// Model files: what is written comes back, and whatever is wrong is named by its JSON pointer.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <set>

#include "model/model.h"

namespace ferrobench::model {
namespace {

using nlohmann::json;
using Pointer = json::json_pointer;
using testing::ElementsAre;

// Every key that a model file may have.
json complete() {
  auto m = library_model("soft-pzt");
  m.actuator.passive_stiffness = 2e8;
  m.polycrystal.critical_force = CriticalForce{.unload = {{0, 3e5}, {0.5, 2e5}, {1, 1e5}},
                                               .load = {{0, -1e5}, {0.4, -2e5}, {1, -3e5}},
                                               .prestress = 4e6,
                                               .prestress_shift = -1e-3};
  m.effects = {{"electrostriction", {{"coefficient", -2e-16}}},
               {"displacement_lag", {{"time_constant", 1e-4}}}};
  return to_json(m);
}

// The pointers of all that is wrong; empty if nothing is.
std::vector<std::string> wrong_in(const json& file) {
  std::vector<std::string> out;
  try {
    model_from_json(file);
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::bad_model);
    for (const auto& p : e.problems()) out.push_back(p.path);
  }
  return out;
}

// Visits every value below `at`, its parent first.
void walk(const json& at, const std::string& path,
          const std::function<void(const std::string&, const json&)>& visit) {
  const auto below = [&](const std::string& key, const json& value) {
    visit(path + "/" + key, value);
    walk(value, path + "/" + key, visit);
  };
  if (at.is_object())
    for (const auto& [key, value] : at.items()) below(key, value);
  if (at.is_array())
    for (std::size_t i = 0; i < at.size(); ++i) below(std::to_string(i), at[i]);
}

class ShippedModel : public testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Library, ShippedModel, testing::ValuesIn(model_library_names()), [](const auto& i) {
  std::string name;
  for (const char c : i.param) name += std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
  return name;
});

TEST_P(ShippedModel, ComesBackAsItWasWritten) {
  const auto written = to_json(library_model(GetParam()));
  EXPECT_EQ(to_json(model_from_json(written)), written);
  EXPECT_EQ(to_json(model_from_text(written.dump())), written);
  EXPECT_FALSE(library_model(GetParam()).name.empty());
}

TEST(Library, NamesTheNearestModel) {
  try {
    library_model("soft-ptz");
    FAIL() << "there is no such model";
  } catch (const Error& e) {
    EXPECT_EQ(e.code(), ErrorCode::not_found);
    EXPECT_THAT(e.what(), testing::HasSubstr("soft-pzt"));
  }
}

TEST(ModelFile, WithEveryKeyComesBack) {
  const auto file = complete();
  ASSERT_THAT(wrong_in(file), ElementsAre());
  EXPECT_EQ(to_json(model_from_json(file)), file);
}

TEST(ModelFile, RefusesAnUnknownKeyAnywhere) {
  int tried = 0;
  const auto file = complete();
  const auto refuse = [&](const std::string& path, const json& value) {
    if (!value.is_object()) return;
    auto broken = file;
    broken[Pointer(path)]["surplus"] = 1;
    EXPECT_THAT(wrong_in(broken), ElementsAre(path + "/surplus"));
    ++tried;
  };
  refuse("", file);
  walk(file, "", refuse);
  EXPECT_EQ(tried, 1 + 4 + 1 + 6 + 2 * 2);  // file, parts, table, its points, effects and their parameters
}

TEST(ModelFile, RefusesAWrongTypeAnywhere) {
  const auto file = complete();
  walk(file, "", [&](const std::string& path, const json& value) {
    auto broken = file;
    broken[Pointer(path)] = value.is_boolean() ? json(1) : json(true);
    EXPECT_THAT(wrong_in(broken), ElementsAre(path));
  });
}

TEST(ModelFile, MissesNoKeyButTheOptionalOnes) {
  const std::set<std::string> optional{"/name",
                                       "/notes",
                                       "/effects",
                                       "/polycrystal/barrier_log_std",
                                       "/polycrystal/interaction_field_std",
                                       "/polycrystal/interaction_stress_std",
                                       "/polycrystal/bias_field",
                                       "/polycrystal/critical_force/prestress_shift",
                                       "/actuator/layer_count",
                                       "/actuator/passive_stiffness"};
  auto file = complete();
  file["polycrystal"]["method"] = "parametrized";
  walk(file, "", [&](const std::string& path, const json&) {
    const Pointer at(path);
    if (!file[at.parent_pointer()].is_object()) return;
    auto broken = file;
    broken[at.parent_pointer()].erase(at.back());
    if (optional.contains(path))
      EXPECT_THAT(wrong_in(broken), ElementsAre()) << path;
    else
      EXPECT_THAT(wrong_in(broken), ElementsAre(path));
  });
}

TEST(ModelFile, RefusesValuesOutOfRange) {
  const std::vector<std::pair<std::string, json>> cases{{"/format", "ferrobench-protocol"},
                                                        {"/version", 2},
                                                        {"/material/remanent_polarization", 0},
                                                        {"/material/remanent_strain_90", 0.003},
                                                        {"/material/temperature", 0},
                                                        {"/material/barrier_law", "cubic"},
                                                        {"/polycrystal/barrier_log_std", -0.1},
                                                        {"/actuator/layer_count", 0},
                                                        {"/actuator/layer_count", 1.5},
                                                        {"/load/spring_stiffness", -1},
                                                        {"/effects/1/parameters/time_constant", -1},
                                                        {"/polycrystal/critical_force/load/1/fraction", 0},
                                                        {"/polycrystal/critical_force/load/2/fraction", 0.3}};
  for (const auto& [path, value] : cases) {
    auto broken = complete();
    broken[Pointer(path)] = value;
    EXPECT_THAT(wrong_in(broken), ElementsAre(path)) << value;
  }
}

TEST(ModelFile, SaysAllThatIsWrongAtOnce) {
  auto broken = complete();
  broken["material"]["temperature"] = "warm";
  broken["load"].erase("prestress");
  broken["actuator"]["width"] = 1;
  EXPECT_THAT(wrong_in(broken),
              testing::UnorderedElementsAre("/material/temperature", "/load/prestress", "/actuator/width"));
}

TEST(ModelFile, RefusesEffectsThatItDoesNotKnow) {
  auto broken = complete();
  broken["effects"][1]["id"] = "displacement_lagg";
  EXPECT_THAT(wrong_in(broken), ElementsAre("/effects/1/id"));
  broken = complete();
  broken["effects"][1] = broken["effects"][0];
  EXPECT_THAT(wrong_in(broken), ElementsAre("/effects/1/id"));
}

TEST(ModelFile, RefusesATableWhoseBranchesCross) {
  auto broken = complete();
  broken["polycrystal"]["critical_force"]["load"][2]["force"] = 1.5e5;
  EXPECT_THAT(wrong_in(broken), testing::Contains("/polycrystal/critical_force/load/2/force"));
  broken = complete();
  broken["polycrystal"]["critical_force"]["unload"] = json::array({{{"fraction", 0.5}, {"force", 1e5}}});
  EXPECT_THAT(wrong_in(broken), ElementsAre("/polycrystal/critical_force/unload"));
}

TEST(ModelFile, ThatIsNoJsonIsRefused) {
  EXPECT_THROW(model_from_text("{\"format\": "), Error);
  EXPECT_THROW(model_from_text("[]"), Error);
  EXPECT_THROW(model_from_file("/nowhere/model.json"), Error);
}

}  // namespace
}  // namespace ferrobench::model
