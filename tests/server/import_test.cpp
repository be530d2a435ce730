// Testers' files over JSON-RPC and at the command line: a recording for each table, and what was found.
#include <gmock/gmock.h>

#include <fstream>

#include "engine_bench.h"
#include "recordings/file/reader.h"
#include "server/cli/cli.h"
#include "server/methods/methods.h"
#include "tests/imports/tester_files.h"

namespace ferrobench::server {
namespace {

using testing::HasSubstr;
using testing::Not;
using ImportTest = EngineTest;

TEST_F(ImportTest, ByRpcEachTableIsARecording) {
  Dispatcher rpc;
  add_all_methods(rpc, engine);
  CallContext caller{.client = "test", .lease = "", .subscriber = nullptr};
  const auto made = rpc.call(
      "recording.import", {{"name", "ceramic"}, {"csv", imports::aixacct_piezo(2, {.offset = 72})}}, caller);
  EXPECT_EQ(made.at("name"), "ceramic-table-01");
  ASSERT_EQ(made.at("recordings").size(), 2u);
  EXPECT_EQ(made.at("recordings")[1].at("name"), "ceramic-table-02");
  EXPECT_THAT(made.at("findings").dump(), HasSubstr("72 V above"));
  EXPECT_EQ(recordings::read_summary(engine.store().recording("ceramic-table-02")).rows, 201u);
  const auto code = [&](const nlohmann::json& given) {
    return code_of([&] { rpc.call("recording.import", given, caller); });
  };
  EXPECT_EQ(code({{"name", "ceramic"}, {"csv", imports::aixacct_piezo(2)}}), ErrorCode::busy);
  EXPECT_EQ(code({{"name", "film"}, {"csv", imports::easyexpert()}}), ErrorCode::invalid_params);
  EXPECT_EQ(code({{"name", "film"}, {"csv", imports::aixacct_piezo(1)}, {"as", "radiant"}}),
            ErrorCode::bad_recording);
  EXPECT_EQ(code({{"name", "film"}, {"csv", "nothing"}, {"as", "tester"}}), ErrorCode::invalid_params);
  EXPECT_FALSE(Store::is_taken(engine.store().recordings() / "film.h5"));
  const auto one =
      rpc.call("recording.import",
               {{"name", "film"}, {"csv", imports::aixacct_pulses()}, {"layer_thickness_m", 1e-7}}, caller);
  EXPECT_EQ(one.at("name"), "film");
}

class ImportCommand : public testing::Test {
 protected:
  std::string put(const std::string& name, const std::string& text) const {
    std::ofstream(folder.path / name, std::ios::binary) << text;
    return (folder.path / name).string();
  }
  int run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"ferrobench", "--data", folder.path.string(), "import"});
    std::vector<const char*> argv;
    for (const auto& a : arguments) argv.push_back(a.c_str());
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    const int code = cli::run_program(static_cast<int>(argv.size()), argv.data());
    out = testing::internal::GetCapturedStdout();
    err = testing::internal::GetCapturedStderr();
    return code;
  }
  std::string place(const std::string& name) const { return (folder.path / name).string(); }

  Folder folder;
  std::string out, err;
};

TEST_F(ImportCommand, AFolderTakesAllTables) {
  const auto file = put("loops.dat", imports::aixacct_piezo(3, {.offset = 72}));
  ASSERT_EQ(run({file, "--out", place("made")}), 0) << err;
  EXPECT_THAT(out, HasSubstr("loops-table-01.h5\n"));
  EXPECT_THAT(out, HasSubstr("loops-table-03.h5\n"));
  EXPECT_THAT(err, HasSubstr("note, tables 1 to 3: the electrode's area is 5e-05 m^2, as the file says"));
  EXPECT_THAT(err, HasSubstr("flag, table 2: Error: underflow"));
  EXPECT_THAT(err, HasSubstr("warning, table 1: the measured voltage lies 72 V above"));
  EXPECT_EQ(recordings::read_recording(place("made/loops-table-02.h5")).size(), 201u);
  EXPECT_NE(run({file, "--out", place("made")}), 0);  // they are there
  EXPECT_EQ(run({file, "--out", place("made"), "--force"}), 0) << err;
  EXPECT_NE(run({file, "--out", place("one.h5")}), 0);
  EXPECT_THAT(err, HasSubstr("a folder, for 3 tables"));
  EXPECT_FALSE(std::filesystem::exists(place("one.h5")));
}

TEST_F(ImportCommand, FilesOfOneNameAreRefusedBeforeAnythingIsWritten) {
  std::filesystem::create_directories(folder.path / "a");
  std::filesystem::create_directories(folder.path / "b");
  const auto first = put("a/loops.dat", imports::aixacct_piezo(1));
  const auto second = put("b/loops.txt", imports::aixacct_piezo(2));
  EXPECT_NE(run({first, second, "--out", place("made"), "--force"}), 0);
  EXPECT_THAT(err, HasSubstr(first));
  EXPECT_THAT(err, HasSubstr(second));
  EXPECT_FALSE(std::filesystem::exists(place("made")));
}

TEST_F(ImportCommand, LengthsInTheUnitsOfTheUser) {
  const auto file = put("forc.csv", imports::easyexpert());
  EXPECT_NE(run({file, "--out", place("made")}), 0);
  EXPECT_THAT(err, HasSubstr("area_m2"));
  EXPECT_THAT(err, HasSubstr("also as area_mm2"));
  ASSERT_EQ(run({file, "--out", place("made"), "--set", "area_um2=10000", "--set", "layer_thickness_nm=200"}),
            0)
      << err;
  const auto r = recordings::read_recording(place("made/forc-table-01.h5"));
  EXPECT_NEAR(r.header.specimen.area, 1e-8, 1e-20);
  EXPECT_NEAR(r.header.specimen.layer_thickness, 200e-9, 1e-18);
  EXPECT_NE(run({file, "--set", "area_um2=-1", "--set", "layer_thickness_nm=200"}), 0);
  EXPECT_THAT(err, HasSubstr("area_um2"));
  EXPECT_THAT(err, HasSubstr("-1"));
  EXPECT_NE(run({file, "--set", "area_um2=1", "--set", "area_m2=1"}), 0);
  EXPECT_THAT(err, HasSubstr("given twice"));
}

TEST_F(ImportCommand, SettingsThatCannotBe) {
  const auto file = put("loops.csv", "time_s,field [kV/mm]\n0,0\n1,1\n2,0\n");
  for (const auto& [settings, said] : std::vector<std::pair<std::vector<std::string>, std::string>>{
           {{"area_mm2=25,0"}, "area_mm2: must be a number: \"25,0\""},
           {{"a~b=1"}, "\"a~b\" leads to no key of the map"},
           {{"field..unit=V"}, "\"field..unit\" leads to no key of the map"},
           {{"time=2", "time.number=1"}, "\"time.number\" leads to no key of the map"},
           {{"delimiter=tab"}, "allowed: \",\", \";\", \"\\t\" or \" \""}}) {
    std::vector<std::string> words{file};
    for (const auto& setting : settings) words.insert(words.end(), {"--set", setting});
    EXPECT_NE(run(words), 0);
    EXPECT_THAT(err, HasSubstr(said));
    EXPECT_THAT(err, Not(HasSubstr("json.exception")));
  }
}

TEST_F(ImportCommand, OneTableIntoAFileAsEver) {
  const auto file = put("loops.csv", "time_s,field [kV/mm]\n0,0\n1,1\n2,0\n");
  ASSERT_EQ(run({file, "--out", place("one.h5"), "--set", "length_m=0.018", "--set", "area_m2=25e-6", "--set",
                 "layer_thickness_m=1e-4"}),
            0)
      << err;
  EXPECT_EQ(out, place("one.h5") + "\n");
  EXPECT_EQ(recordings::read_recording(place("one.h5")).size(), 3u);
  EXPECT_NE(run({file, "--as", "xlsx"}), 0);
  EXPECT_THAT(err, HasSubstr("aixacct"));
}

TEST_F(ImportCommand, TheUsersWordsAreSpelledOut) {
  const auto file = put("bad.dat", "PiezoResult\n\nTable 1\nA [V]\tB\x1b[31m\t\n1\tx\x1b[0m\t\n");
  EXPECT_NE(run({file}), 0);
  EXPECT_THAT(err, HasSubstr("line 5"));
  EXPECT_THAT(err, Not(HasSubstr("\x1b")));
}

}  // namespace
}  // namespace ferrobench::server
