// What of a batch needs no program around it; local.py and slurm.py have the rest.
#include "server/batch/batch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "model/model.h"
#include "server/batch/merge.h"
#include "server/batch/slurm.h"

namespace ferrobench::batch {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
namespace fs = std::filesystem;

class BatchTest : public testing::Test {
 protected:
  BatchTest() {
    auto name = (fs::temp_directory_path() / "batch-XXXXXX").string();
    folder_ = mkdtemp(name.data());
    std::ofstream(folder_ / "a.h5") << "a";
    std::ofstream(folder_ / "b.csv") << "b";
  }
  ~BatchTest() override { fs::remove_all(folder_); }
  BatchTest(const BatchTest&) = delete;
  BatchTest& operator=(const BatchTest&) = delete;

  std::vector<Item> read(Kind kind, const json& manifest) {
    std::ofstream(folder_ / "manifest.json") << manifest.dump();
    return read_manifest(kind, (folder_ / "manifest.json").string(), server::Store(folder_ / "data"));
  }
  std::vector<std::string> wrong(Kind kind, const json& manifest) {
    std::vector<std::string> out;
    try {
      read(kind, manifest);
    } catch (const Error& error) {
      for (const auto& p : error.problems()) out.push_back(p.path);
    }
    return out;
  }

  fs::path folder_;
};

TEST_F(BatchTest, AnItemHasAllThatItNeeds) {
  const auto items =
      read(Kind::discover, {{"model", "soft-pzt"},
                            {"options", {{"floor", 0.01}, {"seed", 3}}},
                            {"items",
                             {{{"id", "x"}, {"recordings", {"a.h5", "b.csv"}}, {"held_out", {"a.h5"}}},
                              {{"id", "y"}, {"recordings", {"a.h5"}}, {"options", {{"seed", 4}}}}}}});
  ASSERT_EQ(items.size(), 2u);
  EXPECT_EQ(items[0].model, model::to_json(model::library_model("soft-pzt")));
  EXPECT_EQ(items[0].inputs[0].path, (folder_ / "a.h5").string());
  EXPECT_THAT(items[0].held_out, ElementsAre("a"));
  EXPECT_EQ(items[0].options.at("seed"), 3);
  EXPECT_EQ(items[1].options.at("seed"), 4);
  EXPECT_EQ(items[1].options.at("floor"), 0.01);
  EXPECT_EQ(items[1].options.at("report"), true);
}

TEST_F(BatchTest, EachKindTakesWhatItWorksOn) {
  const json recording{{"id", "x"}, {"recordings", {"a.h5"}}}, file{{"id", "x"}, {"files", {"b.csv"}}};
  EXPECT_THAT(wrong(Kind::report, {{"items", {recording}}}), ElementsAre());
  EXPECT_THAT(wrong(Kind::import, {{"items", {file}}}), ElementsAre());
  EXPECT_THAT(wrong(Kind::fit, {{"model", "soft-pzt"}, {"items", {recording}}}), ElementsAre());
  EXPECT_THAT(wrong(Kind::report, {{"items", {file}}}), ElementsAre("/items/0/files", "/items/0/recordings"));
  EXPECT_THAT(wrong(Kind::import, {{"items", {recording}}}),
              ElementsAre("/items/0/recordings", "/items/0/files"));
  EXPECT_THAT(wrong(Kind::report, {{"model", "soft-pzt"}, {"items", {recording}}}), ElementsAre("/model"));
  EXPECT_THAT(wrong(Kind::fit, {{"items", {recording}}}), ElementsAre("/items/0/model"));
}

TEST_F(BatchTest, OptionsAreCheckedBeforeAnythingBegins) {
  const json items{{{"id", "x"}, {"recordings", {"a.h5"}}}};
  const auto with = [&](Kind kind, const json& options) {
    return wrong(kind, {{"model", "soft-pzt"}, {"items", items}, {"options", options}});
  };
  EXPECT_THAT(with(Kind::discover, {{"flor", 1}}), ElementsAre("/options/flor"));
  EXPECT_THAT(with(Kind::discover, {{"candidates", {"domain_wall_drag", "drag"}}}),
              ElementsAre("/options/candidates/1"));
  EXPECT_THAT(with(Kind::fit, {{"tables", {"3.11"}}}), ElementsAre("/options/tables"));
  EXPECT_THAT(with(Kind::fit, {{"calibrate", true}, {"report", true}}), ElementsAre("/options/report"));
  EXPECT_THAT(with(Kind::discover, 3), ElementsAre("/options"));
  EXPECT_THAT(wrong(Kind::import, {{"items", {{{"id", "x"}, {"files", {"b.csv"}}}}},
                                   {"options", {{"as", "paper"}, {"map", {{"csv", "t"}, {"area_m2", -1}}}}}}),
              ElementsAre("/options/as", "/options/map/csv", "/options/map/area_m2"));
}

TEST_F(BatchTest, NoManifestOverwhelmsItsReader) {
  json items = json::array();
  for (int i = 0; i < 5000; ++i) items.push_back({{"id", "?"}, {"recordings", {"none.h5"}}});
  const auto paths = wrong(Kind::report, {{"items", items}});
  EXPECT_GE(paths.size(), max_problems);
  EXPECT_LE(paths.size(), max_problems + 10);
}

TEST(Array, NamesEachTaskOnce) {
  const auto array = [](const std::vector<std::int64_t>& tasks) {
    std::vector<Place> places;
    for (const auto task : tasks) places.push_back({.task = task, .index = 0, .id = ""});
    return array_of(places);
  };
  EXPECT_EQ(array({0}), "0");
  EXPECT_EQ(array({3, 0, 1, 1, 2, 7, 9, 8}), "0-3,7-9");
  EXPECT_EQ(array({5, 3}), "3,5");
}

TEST_F(BatchTest, TasksAreStretchesOfTheManifest) {
  std::vector<Item> items;
  for (int i = 0; i < 7; ++i) items.push_back({.id = "i" + std::to_string(i)});
  const BatchFolder folder(folder_ / "out");
  const auto plan = BatchFolder::make_plan(Kind::report, items, 3);
  folder.put_plan(plan, items);
  EXPECT_EQ(folder.plan()->tasks(), 3);
  EXPECT_EQ(folder.task(1).front().id, "i3");
  EXPECT_EQ(folder.task(2).size(), 1u);
  std::ofstream(folder_ / "out/batch.json") << "{}";
  EXPECT_THROW((void)folder.plan(), Error);
  std::ofstream(folder_ / "out/tasks/1.json") << "[{}]";
  EXPECT_THROW((void)folder.task(1), Error);
}

TEST_F(BatchTest, AResultThatIsNotWholeIsMissing) {
  const BatchFolder folder(folder_ / "out");
  for (const char* text :
       {"", "{", "[]", R"({"id": "x"})", R"({"id": "y", "asked": {}, "state": "failed", "error": {}})",
        R"({"id": "x", "asked": {}, "state": "done", "rows": []})",
        R"({"id": "x", "asked": {}, "state": 3})"}) {
    std::ofstream(folder.result("x")) << text;
    EXPECT_TRUE(read_result("x", folder).is_null()) << text;
  }
}

ItemResult discovered(const std::string& id, const std::string& verdict,
                      const std::vector<std::string>& effects, double barrier) {
  json explanations = json::array();
  for (const auto& e : effects) explanations.push_back({{"effects", {{{"id", e}}}}, {"probability", 0.5}});
  return {id,
          {{"id", id},
           {"state", "done"},
           {"asked", {{"commit", "c"}, {"software", "1"}}},
           {"rows",
            {{{"verdict", verdict},
              {"material.barrier", barrier},
              {"material.barrier.std", 1.0},
              {"probability", 1 - 1e-6 * barrier}}}},
           {"units", {{"material.barrier", "J/m^3"}}},
           {"products", json::array()},
           {"result", {{"verdict", verdict}, {"explanations", explanations}}}}};
}

TEST(Merged, TellsWhatStandsOutInTheFleet) {
  std::vector<ItemResult> results;
  for (int i = 0; i < 9; ++i)
    results.push_back(discovered("s" + std::to_string(i), "named", {"drag"}, 100 + i % 3));
  results.push_back(discovered("far", "ambiguous", {"leak", "drag"}, 140));
  results.push_back({"lost", nullptr});
  results.push_back(
      {"bad",
       {{"id", "bad"},
        {"state", "failed"},
        {"asked", nullptr},
        {"error", {{"message", "no"}, {"problems", {{{"path", "/x"}, {"message", "is wrong"}}}}}}}});
  const auto table = merged_table(Kind::discover, results);
  ASSERT_EQ(table.rows.size(), 12u);
  EXPECT_EQ(std::get<std::string>(table.rows[10][1]), "missing");
  EXPECT_EQ(std::get<std::string>(table.rows[11][2]), "no; /x is wrong");

  // Median of 100 101 102, three times each, and 140: 101; distances 0 (3), 1 (6), 39: 1.
  const auto fleet = fleet_table(table);
  ASSERT_EQ(fleet.rows.size(), 2u);  // the probability is the first
  EXPECT_EQ(std::get<std::string>(fleet.rows[1][0]), "material.barrier");
  EXPECT_EQ(std::get<std::int64_t>(fleet.rows[1][2]), 10);
  EXPECT_DOUBLE_EQ(std::get<double>(fleet.rows[1][3]), 101);
  EXPECT_DOUBLE_EQ(std::get<double>(fleet.rows[1][4]), 1.4826);
  const auto outliers = outlier_table(table);
  ASSERT_EQ(outliers.rows.size(), 1u);
  EXPECT_EQ(std::get<std::string>(outliers.rows[0][0]), "far");
  EXPECT_DOUBLE_EQ(std::get<double>(outliers.rows[0][5]), 39 / 1.4826);

  const auto effects = effects_table(results);
  ASSERT_EQ(effects.rows.size(), 2u);
  EXPECT_EQ(std::get<std::string>(effects.rows[0][0]), "drag");
  EXPECT_EQ(std::get<std::int64_t>(effects.rows[0][1]), 9);
  EXPECT_EQ(std::get<std::string>(effects.rows[0][3]), "far");
  EXPECT_EQ(std::get<std::string>(effects.rows[1][0]), "leak");
}

TEST_F(BatchTest, DifferentCommitsAreNotPutTogether) {
  std::vector<ItemResult> results{discovered("a", "named", {"drag"}, 1),
                                  discovered("b", "named", {"drag"}, 1)};
  const BatchFolder folder(folder_ / "out");
  put_merged(Kind::discover, results, folder);
  const auto size = fs::file_size(folder.path() / "table.h5");
  results[1].result["asked"]["commit"] = "d";
  fs::remove(folder.path() / "table.csv");
  EXPECT_THROW(put_merged(Kind::discover, results, folder), Error);
  EXPECT_FALSE(fs::exists(folder.path() / "table.csv"));
  EXPECT_EQ(fs::file_size(folder.path() / "table.h5"), size);
}

}  // namespace
}  // namespace ferrobench::batch
