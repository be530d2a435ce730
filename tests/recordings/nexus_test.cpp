// The recording in the eyes of a viewer that knows NeXus and nothing of this program.
#include <gtest/gtest.h>
#include <spawn.h>
#include <sys/wait.h>

#include <nlohmann/json.hpp>

#include "recordings/file/writer.h"
#include "tests/recordings/sample.h"

namespace ferrobench::recordings {
namespace {

int run_check(const std::string& file, const nlohmann::json& expected) {
  std::string python = FERROBENCH_PYTHON, script = FERROBENCH_NEXUS_CHECK, path = file,
              text = expected.dump();
  std::array<char*, 5> arguments{python.data(), script.data(), path.data(), text.data(), nullptr};
  pid_t child = 0;
  if (posix_spawnp(&child, python.c_str(), nullptr, nullptr, arguments.data(), environ) != 0) return 77;
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(Nexus, DefaultPlotUnitsAndLengths) {
  const testing::TemporaryFolder folder;
  auto r = testing::play(0, {{1e6, 2}, {1e6, 3}, {-5e5, 1.5}}, 5000);
  r.set(Channel::displacement).assign(r.size(), 1e-6);
  r.set(Channel::charge).assign(r.size(), 1e-6);
  const std::array<Channel, 4> channels{Channel::command, Channel::field, Channel::charge,
                                        Channel::displacement};
  const auto path = folder.file("run.h5");
  Writer writer(path, r.header, channels);
  Rows rows{.time = r.time, .channels = {}, .counts = {}};
  for (const auto channel : channels) rows.channels.at(static_cast<std::size_t>(channel)) = r.at(channel);
  writer.append(rows);
  writer.add_event({1, "note", "späte Notiz"});
  writer.finish("complete", "", r.segments, {});

  const int result = run_check(path, {{"signal", "displacement"},
                                      {"rows", 32501},
                                      {"duration", 6.5},
                                      {"columns", {"command", "field", "charge", "displacement"}},
                                      {"messages", {"späte Notiz"}}});
  if (result == 77) GTEST_SKIP() << "python3 with h5py is not installed";
  EXPECT_EQ(result, 0);
}

TEST(Nexus, WithoutDisplacementAnotherSignalIsShown) {
  const testing::TemporaryFolder folder;
  auto r = testing::play(0, {{1e6, 2}, {1e6, 3}, {-5e5, 1.5}}, 10);
  r.set(Channel::force).assign(r.size(), 1);
  const auto path = folder.file("force.h5");
  write_recording(path, r);
  const int result = run_check(path, {{"signal", "force"},
                                      {"rows", 66},
                                      {"duration", 6.5},
                                      {"columns", {"command", "field", "force"}},
                                      {"messages", nlohmann::json::array()}});
  if (result == 77) GTEST_SKIP() << "python3 with h5py is not installed";
  EXPECT_EQ(result, 0);
}

}  // namespace
}  // namespace ferrobench::recordings
