// One system call of a recording run fails, call after call: either nothing comes of it, or the run reports
// it, with the output at zero, and what was recorded can be read. FERROBENCH_EVERY_CALL=1 takes every call,
// else a sample of them.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <sstream>

#include "recordings/disk/new_file.h"
#include "recordings/file/reader.h"
#include "recordings/file/recover.h"
#include "tests/server/engine_bench.h"

namespace ferrobench::faults {
namespace {

namespace fs = std::filesystem;
using recordings::Recording;

struct Said {
  int code = 0;
  std::string err;
};

class Syscalls : public ::testing::TestWithParam<const char*> {
 protected:
  Syscalls() {
    std::ofstream(folder.path / "program.json") << server::trapezium(0.2, 0.5).dump();
    fs::create_directories(folder.path / "out");
  }
  std::string file() const { return (folder.path / "out" / "run.h5").string(); }

  Said run(const std::string& kind, long at, bool fast = true) {
    const auto said = (folder.path / "said").string();
    fs::remove(folder.path / "count.shared");
    std::ostringstream command;
    command << "FERROBENCH_DATA=" << folder.path / "data"
            << " FAULT_FOLDER=" << folder.path / "out"
            << " FAULT_KIND=" << kind << " FAULT_AT=" << at << " FAULT_COUNT=" << folder.path / "count"
            << " ASAN_OPTIONS=verify_asan_link_order=0 LD_PRELOAD=" << FERROBENCH_SHIM << ' '
            << FERROBENCH_PROGRAM << " run " << folder.path / "program.json"
            << " --model soft-pzt --quiet" << (fast ? " --fast" : "") << " --out " << file()
            << " >/dev/null 2>" << said;
    const int status = std::system(command.str().c_str());
    std::ostringstream text;
    text << std::ifstream(said).rdbuf();
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, text.str()};
  }
  long calls() const {
    long out = 0;
    std::ifstream(folder.path / "count") >> out;
    return out;
  }
  void clear() {
    for (const auto& entry : fs::directory_iterator(folder.path / "out")) fs::remove(entry.path());
  }

  // The first samples of the whole recording, bit for bit.
  static void expect_part(const Recording& part, const Recording& whole) {
    ASSERT_LE(part.size(), whole.size());
    for (const auto channel : recordings::all_channels) {
      ASSERT_EQ(part.has(channel), whole.has(channel));
      if (!part.has(channel)) continue;
      EXPECT_TRUE(std::equal(part.at(channel).begin(), part.at(channel).end(), whole.at(channel).begin()))
          << channel_name(channel);
    }
  }

  server::Folder folder;
};

TEST_P(Syscalls, AFailureIsReportedOrHasNoEffect) {
  const std::string kind = GetParam();
  const bool harmless = kind == "EINTR" || kind == "short";
  ASSERT_EQ(run(kind, 0).code, 0);
  const auto whole = recordings::read_recording(file());
  const long count = calls();
  ASSERT_GT(count, 30);
  const bool every = std::getenv("FERROBENCH_EVERY_CALL") != nullptr;
  const long step = every ? 1 : std::max(1L, count / 9);
  int reported = 0, without_effect = 0, recovered = 0;
  for (long at = 1; at <= count + 2; at += step) {
    SCOPED_TRACE(kind + " at call " + std::to_string(at) + " of " + std::to_string(count));
    clear();
    const auto said = run(kind, at);
    ASSERT_TRUE(said.code == 0 || said.code == 1) << said.code << said.err;
    EXPECT_EQ(said.err.find("may not be at zero"), std::string::npos) << said.err;
    if (harmless) {
      EXPECT_EQ(said.code, 0) << said.err;
    }
    if (said.code == 0) {
      ++without_effect;
      const auto r = recordings::read_recording(file());
      EXPECT_EQ(r.size(), whole.size());
      EXPECT_EQ(r.status, "complete");
      expect_part(r, whole);
    } else {
      ++reported;
      EXPECT_NE(said.err.find("ferrobench: "), std::string::npos) << said.err;
    }
    const bool left = recordings::journal_state(file()) == recordings::JournalState::left;
    if (left) {
      EXPECT_NO_THROW(recordings::recover_recording(file()));
      ++recovered;
    }
    EXPECT_EQ(recordings::journal_state(file()), recordings::JournalState::none);
    recordings::remove_leftovers((folder.path / "out").string());  // where the removal was what failed
    for (const auto& entry : fs::directory_iterator(folder.path / "out"))
      EXPECT_NE(entry.path().extension(), ".part") << entry.path();
    if (fs::exists(file())) expect_part(recordings::read_recording(file()), whole);
  }
  std::cout << kind << ": " << count << " calls; " << without_effect << " without effect, " << reported
            << " reported, " << recovered << " of them left to recovery\n";
  if (!harmless) {
    EXPECT_GT(reported, 0);
  }
}
using SlowDisk = Syscalls;

TEST_P(SlowDisk, IsNotedOrEndsTheRunWithTheOutputAtZero) {
  const std::string kind = GetParam();
  std::ofstream(folder.path / "program.json") << server::trapezium(0.4, kind == "slow" ? 1 : 60).dump();
  const auto begin = std::chrono::steady_clock::now();
  // What hangs is to be a call of the run, and not of those that make sure of its place before.
  const auto said = run(kind, kind == "slow" ? 12 : 40, false);
  const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
  EXPECT_EQ(said.err.find("may not be at zero"), std::string::npos) << said.err;
  const auto r = recordings::read_recording(file());
  if (kind == "slow") {
    EXPECT_EQ(said.code, 0) << said.err;
    EXPECT_EQ(r.status, "complete");
    EXPECT_TRUE(std::ranges::any_of(r.events, [](const auto& event) { return event.kind == "slow_disk"; }));
  } else {
    EXPECT_EQ(said.code, 1);
    EXPECT_NE(said.err.find("the disk does not"), std::string::npos) << said.err;
    EXPECT_EQ(r.status, "aborted");
    EXPECT_LT(spent.count(), 40);
  }
}
INSTANTIATE_TEST_SUITE_P(Each, SlowDisk, ::testing::Values("slow", "hang"));
INSTANTIATE_TEST_SUITE_P(Each, Syscalls, ::testing::Values("EIO", "ENOSPC", "EINTR", "short", "full"));

}  // namespace
}  // namespace ferrobench::faults
