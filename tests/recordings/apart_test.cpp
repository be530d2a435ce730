// The child process that reads HDF5 files, and how it may end.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>

#include "base/error.h"
#include "recordings/file/reader.h"
#include "recordings/file/writer.h"
#include "recordings/hdf5/read_apart.h"
#include "tests/recordings/sample.h"

namespace ferrobench::recordings {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using testing::TemporaryFolder;

class Apart : public ::testing::Test {
 protected:
  std::string recording(const std::string& name) const {
    const auto path = folder.file(name);
    auto r = testing::play(0, {{1e6, 1}, {1e6, 1}, {0, 1}}, 2000);
    r.header.title = name;
    write_recording(path, r);
    return path;
  }
  static Error error_of(const std::string& path, const ReadLimits& limits) {
    try {
      read_apart(path, limits);
    } catch (const Error& error) {
      return error;
    }
    throw std::runtime_error("was read");
  }

  const TemporaryFolder folder;
};

TEST_F(Apart, TakingTooLongIsSaidAndIsNoCrash) {
  const auto path = recording("a.h5");
  auto limits = limits_for(path);
  limits.clock = std::chrono::milliseconds(1);  // a process takes longer to start
  const auto error = error_of(path, limits);
  EXPECT_EQ(error.code(), ErrorCode::bad_recording);
  EXPECT_THAT(error.what(), HasSubstr("took longer to read than the 0.001 s"));
  EXPECT_THAT(error.what(), Not(HasSubstr("crash")));
}

TEST_F(Apart, TakingTooMuchOfTheProcessorIsSaidAndIsNoCrash) {
  const auto path = folder.file("long.h5");
  write_recording(path, testing::play(0, {{1e6, 200}, {0, 200}}, 2000));
  auto limits = limits_for(path);
  limits.processor = std::chrono::milliseconds(1);
  const auto error = error_of(path, limits);
  EXPECT_THAT(error.what(), HasSubstr("more than 0.001 s of processor time"));
  EXPECT_THAT(error.what(), Not(HasSubstr("crash")));
  EXPECT_EQ(read_recording(path).size(), 800'001u);
}

TEST_F(Apart, MoreMemoryThanAllowedIsSaidWithFigures) {
  const auto path = recording("a.h5");
  auto limits = limits_for(path);
  limits.recording_bytes = 100'000;
  const auto error = error_of(path, limits);
  EXPECT_THAT(error.what(), HasSubstr("takes 0.000144 GB of memory, and at most 0.0001 GB are allowed"));
  EXPECT_NO_THROW(read_apart(path, limits_for(path)));
}

TEST_F(Apart, OfManyEachHasItsOwnAnswer) {
  std::vector<std::string> paths;
  for (int i = 0; i < 50; ++i) paths.push_back(recording(std::to_string(i) + ".h5"));
  std::ofstream(paths[7]) << "no recording";
  std::filesystem::remove(paths[20]);
  std::filesystem::remove(paths[30]);
  ASSERT_EQ(mkfifo(paths[30].c_str(), 0600), 0);
  const auto read = read_summaries(paths);
  ASSERT_EQ(read.size(), paths.size());
  for (std::size_t i = 0; i < read.size(); ++i) {
    SCOPED_TRACE(i);
    if (i == 7 || i == 20 || i == 30) {
      EXPECT_EQ(std::get<Error>(read[i]).code(), i == 20 ? ErrorCode::not_found : ErrorCode::bad_recording);
    } else {
      EXPECT_EQ(std::get<Summary>(read[i]).header.title, std::to_string(i) + ".h5");
      EXPECT_EQ(std::get<Summary>(read[i]).rows, 6001u);
    }
  }
  EXPECT_TRUE(read_summaries({}).empty());
}

// A child has the file that it reads and what it needs to tell of it.
TEST_F(Apart, NothingIsLeftBehind) {
  const auto path = recording("a.h5");
  const auto open_files = [] {
    return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {});
  };
  const auto before = open_files();
  for (int i = 0; i < 5; ++i) {
    read_recording(path);
    auto limits = limits_for(path);
    limits.clock = std::chrono::milliseconds(1);
    error_of(path, limits);
  }
  EXPECT_EQ(open_files(), before);
  EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1);  // no child, not even a dead one
}

}  // namespace
}  // namespace ferrobench::recordings
