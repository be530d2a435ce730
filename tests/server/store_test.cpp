// What the folder of the bench keeps: names that several want at once, links and what else lies there.
#include "server/engine/store.h"

#include <sys/stat.h>

#include <atomic>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <thread>

#include "engine_bench.h"
#include "recordings/file/reader.h"
#include "server/methods/methods.h"

namespace ferrobench::server {
namespace {

using StoreTest = EngineTest;

// What lies in the folder of the models need not be one, nor end, nor be a file.
TEST_F(StoreTest, ABadModelIsNamedAndTheOthersAreListed) {
  const auto models = folder.path / "models";
  engine.store().put_model("mine", engine.store().model("soft-pzt"));
  std::ofstream(models / "cut.json") << R"({"format": "ferrobench-model", "ver)";
  std::ofstream(models / "empty.json");
  std::filesystem::create_directory(models / "folder.json");
  std::filesystem::create_symlink("/dev/zero", models / "endless.json");
  ASSERT_EQ(mkfifo((models / "pipe.json").c_str(), 0600), 0);
  Dispatcher rpc;
  add_all_methods(rpc, engine);
  CallContext caller{.client = "test", .lease = "", .subscriber = nullptr};
  std::map<std::string, std::string> listed;
  const auto rows = rpc.call("model.list", nlohmann::json::object(), caller).at("models");
  for (const auto& row : rows) listed[row.at("name")] = row.at("error");
  EXPECT_EQ(listed.at("mine"), "");
  EXPECT_EQ(listed.at("soft-pzt"), "");
  EXPECT_NE(listed.at("cut"), "");
  EXPECT_NE(listed.at("empty"), "");
  EXPECT_NE(listed.at("folder").find("is a folder"), std::string::npos) << listed.at("folder");
  EXPECT_NE(listed.at("endless").find("is a device"), std::string::npos) << listed.at("endless");
  EXPECT_NE(listed.at("pipe").find("is a pipe"), std::string::npos) << listed.at("pipe");
}

TEST_F(StoreTest, NoLinkIsFollowedForWriting) {
  const auto precious = folder.path / "precious";
  std::ofstream(precious) << "precious";
  const auto model = engine.store().model("soft-pzt");
  for (const auto* name : {"mine.json", "mine.json.part"})
    std::filesystem::create_symlink(precious, folder.path / "models" / name);
  EXPECT_EQ(code_of([&] { engine.store().put_model("mine", model); }), ErrorCode::io_error);
  const auto status = finish(request(trapezium(0.2, 0.1), true));
  for (const auto* end : {".csv", ".h5.part"})
    std::filesystem::create_symlink(precious, folder.path / "recordings" / (status.recording + end));
  Dispatcher rpc;
  add_all_methods(rpc, engine);
  CallContext caller{.client = "test", .lease = "", .subscriber = nullptr};
  EXPECT_EQ(code_of([&] {
              rpc.call("recording.export", {{"name", status.recording}}, caller);
            }),
            ErrorCode::io_error);
  rpc.call("recording.annotate", {{"name", status.recording}, {"text", "a note"}}, caller);
  EXPECT_EQ(recordings::read_recording(status.path).events.back().message, "a note");
  std::ifstream text(precious);
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(text), {}), "precious");
}

TEST_F(StoreTest, OfManyImportsOfOneNameOneIsMade) {
  Dispatcher rpc;
  add_all_methods(rpc, engine);
  for (int round = 0; round < 5; ++round) {
    const auto name = "given-" + std::to_string(round);
    std::atomic<int> made = 0;
    std::string title;
    {
      std::vector<std::jthread> all;
      for (int i = 0; i < 6; ++i)
        all.emplace_back([&, mine = "import " + std::to_string(i)] {
          CallContext caller{.client = mine, .lease = "", .subscriber = nullptr};
          try {
            rpc.call("recording.import",
                     {{"name", name},
                      {"title", mine},
                      {"csv", "t,E\n0,0\n1,1\n2,0\n"},
                      {"time", {{"column", "t"}}},
                      {"field", {{"column", "E"}}},
                      {"length_m", 0.01},
                      {"area_m2", 1e-4},
                      {"layer_thickness_m", 1e-4}},
                     caller);
            title = mine;
            ++made;
          } catch (const Error& error) {
            EXPECT_EQ(error.code(), ErrorCode::busy) << error.what();
          }
        });
    }
    EXPECT_EQ(made, 1);
    EXPECT_EQ(recordings::read_summary(engine.store().recording(name)).header.title, title);
  }
}

// Each start of another program in the same folder and second asks for the same name.
TEST_F(StoreTest, ANameThatIsTakenInBetweenIsLeftToTheOther) {
  const auto status = finish(request(trapezium(0.2, 0.1), true));
  const auto recording = recordings::read_recording(status.path);
  std::set<std::string> paths;
  {
    std::mutex mutex;
    std::vector<std::jthread> all;
    for (int i = 0; i < 6; ++i)
      all.emplace_back([&] {
        const auto path = Store(folder.path).add_recording("twin", recording).string();
        const std::scoped_lock lock(mutex);
        paths.insert(path);
      });
  }
  EXPECT_EQ(paths.size(), 6u);
  for (const auto& path : paths) EXPECT_EQ(recordings::read_recording(path).size(), recording.size());
}

}  // namespace
}  // namespace ferrobench::server
