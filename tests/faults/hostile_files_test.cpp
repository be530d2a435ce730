// Recordings made to harm, in the folder of a daemon that has a run under way: whoever lists, views and
// reports them is refused by an error or served, within what one view may take, and meanwhile the run goes on
// and is stopped at once.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <spawn.h>
#include <sys/wait.h>

#include <csignal>
#include <fstream>
#include <future>

#include "server/net/client.h"
#include "tests/faults/damage.h"
#include "tests/server/engine_bench.h"

namespace ferrobench::faults {
namespace {

using nlohmann::json;
using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds prompt{
    3};  // for what waits for nobody, on a machine that has other things to do

class HostileFiles : public testing::Test {
 protected:
  HostileFiles() {
    const auto data = (folder.path / "data").string(), token = (folder.path / "token").string();
    std::vector<std::string> words{FERROBENCH_PROGRAM, "--data", data,           "serve",
                                   "--port",           "0",      "--token-file", token};
    std::vector<char*> arguments;
    for (auto& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    const auto log = (folder.path / "log").string();
    posix_spawn_file_actions_addopen(&files, 1, log.c_str(), O_WRONLY | O_CREAT, 0600);
    posix_spawn_file_actions_adddup2(&files, 1, 2);
    EXPECT_EQ(posix_spawn(&daemon, words[0].c_str(), &files, nullptr, arguments.data(), environ), 0);
    posix_spawn_file_actions_destroy(&files);
    for (int i = 0; i < 600 && !server::Client::try_connect(socket()); ++i) usleep(50'000);
    recordings = folder.path / "data" / "recordings";
  }
  ~HostileFiles() override {
    kill(daemon, SIGTERM);
    waitpid(daemon, nullptr, 0);
  }

  std::string socket() const { return (folder.path / "data" / "daemon.sock").string(); }
  json ask(const std::string& method, const json& params = json::object()) const {
    return server::Client::connect(socket()).call(method, params);
  }
  // Whether it was served. An error must be one that somebody thought of.
  bool served(const std::string& method, const json& params) const {
    try {
      ask(method, params);
      return true;
    } catch (const Error& error) {
      EXPECT_NE(error.code(), ErrorCode::internal) << method << params << error.what();
      EXPECT_NE(error.code(), ErrorCode::io_error) << method << params << error.what();
      return false;
    }
  }
  std::string begin_run() const {
    const auto run =
        ask("run.start", {{"protocol", server::trapezium(0.2, 3600)}, {"model", "soft-pzt"}})["run"];
    for (int i = 0; i < 600 && ask("run.status")["state"] != "running"; ++i) usleep(20'000);
    return run.get<std::string>();
  }
  void stop_run(const std::string& run) const {
    EXPECT_EQ(ask("run.status")["state"], "running");
    EXPECT_EQ(ask("run.status")["run"], run);
    const auto begin = Clock::now();
    ask("run.abort");
    EXPECT_LT(Clock::now() - begin, prompt);
    for (int i = 0; i < 600 && ask("run.status")["state"] != "aborted"; ++i) usleep(20'000);
    const auto status = ask("run.status");
    EXPECT_EQ(status["state"], "aborted");
    EXPECT_TRUE(status["output_at_zero"].get<bool>());
  }
  // The most memory that the daemon has had, in MiB.
  double most_memory() const {
    std::ifstream file("/proc/" + std::to_string(daemon) + "/status");
    for (std::string line; std::getline(file, line);)
      if (line.starts_with("VmHWM:")) return std::stod(line.substr(6)) / 1024;
    ADD_FAILURE() << "the daemon has died";
    return 0;
  }

  const server::Folder folder;
  std::filesystem::path recordings;
  pid_t daemon = 0;
};

TEST_F(HostileFiles, WrongStructureWithRightChecksumsKillsNobody) {
  const auto run = begin_run();
  constexpr int files = 30;
  const auto bytes = forged_files(files, 1, folder.path / "made");
  for (int i = 0; i < files; ++i)
    std::ofstream(recordings / ("forged-" + std::to_string(i) + ".h5"), std::ios::binary) << bytes[i];
  EXPECT_TRUE(served("recording.list", json::object()));
  // One by one some of them, as each takes a process or two.
  constexpr int viewed = 12;
  int refused = 0;
  for (int i = 0; i < viewed; ++i)
    refused += served("recording.report", {{"name", "forged-" + std::to_string(i)}}) ? 0 : 1;
  EXPECT_GT(refused, viewed / 4) << "these files harm nobody";
  EXPECT_TRUE(served("recording.list", json::object()));
  stop_run(run);
}

TEST_F(HostileFiles, ZerosThatUnpackToGigabytesAreRefused) {
  const auto run = begin_run();
  write_zeros(100'000'000, recordings / "zeros.h5", folder.path / "made");
  EXPECT_LT(std::filesystem::file_size(recordings / "zeros.h5"), 10'000'000u);
  for (const auto* method : {"recording.read", "recording.report"}) {
    auto view = std::async(std::launch::async, [&]() -> std::optional<Error> {
      try {
        ask(method, {{"name", "zeros"}});
      } catch (const Error& error) {
        return error;
      }
      return std::nullopt;
    });
    const auto begin = Clock::now();
    while (view.wait_for(std::chrono::milliseconds(50)) != std::future_status::ready) {
      const auto asked = Clock::now();
      ask("run.status");
      EXPECT_LT(Clock::now() - asked, prompt);
    }
    const auto error = view.get();
    ASSERT_TRUE(error) << method;
    EXPECT_LT(Clock::now() - begin, std::chrono::seconds(20)) << method;
    ASSERT_FALSE(error->problems().empty()) << error->what();
    EXPECT_NE(error->problems()[0].hint, "") << error->what();
  }
  EXPECT_LT(most_memory(), 500);
  stop_run(run);
}

// Less than a view's budget, so they are unpacked: that is what the run must not feel.
TEST_F(HostileFiles, ARunIsStoppedWhileZerosAreUnpacked) {
  const auto run = begin_run();
  write_zeros(15'000'000, recordings / "zeros.h5", folder.path / "made");
  std::vector<std::future<bool>> views;
  for (int i = 0; i < 4; ++i)
    views.push_back(std::async(std::launch::async, [&] {
      return served("recording.report", {{"name", "zeros"}});
    }));
  usleep(500'000);
  stop_run(run);
  for (auto& view : views) view.get();
}

}  // namespace
}  // namespace ferrobench::faults
