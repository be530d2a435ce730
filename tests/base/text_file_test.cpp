// Files that a user names: read whole, never waited for, never without end.
#include "base/text_file.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <thread>

namespace ferrobench {
namespace {

using ::testing::HasSubstr;

class TextFile : public ::testing::Test {
 protected:
  TextFile() {
    auto name = (std::filesystem::temp_directory_path() / "text-XXXXXX").string();
    folder = mkdtemp(name.data());
  }
  ~TextFile() override { std::filesystem::remove_all(folder); }

  std::string written(const std::string& text) const {
    const auto path = (folder / "file").string();
    std::ofstream(path, std::ios::binary) << text;
    return path;
  }
  static std::string refusal(const std::string& path, Pipes pipes) {
    try {
      return "read: " + read_text_file(path, 1000, ErrorCode::bad_model, pipes);
    } catch (const Error& error) {
      return std::string(entry(error.code()).name) + ": " + error.what();
    }
  }

  std::filesystem::path folder;
};

TEST_F(TextFile, IsReadUpToItsLimit) {
  EXPECT_EQ(read_text_file(written(""), 1000, ErrorCode::bad_model), "");
  const std::string text(1000, 'x');
  EXPECT_EQ(read_text_file(written(text), 1000, ErrorCode::bad_model), text);
  EXPECT_THAT(refusal(written(text + 'x'), Pipes::refuse), HasSubstr("bad_model"));
  EXPECT_THAT(refusal((folder / "none").string(), Pipes::refuse), HasSubstr("not_found"));
}

TEST_F(TextFile, WhatNeverEndsIsRefused) {
  const auto pipe = (folder / "pipe").string();
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  for (const auto pipes : {Pipes::refuse, Pipes::read}) {
    EXPECT_THAT(refusal("/dev/zero", pipes), HasSubstr("is a device"));
    EXPECT_THAT(refusal(folder.string(), pipes), HasSubstr("is a folder"));
  }
  EXPECT_THAT(refusal(pipe, Pipes::refuse), HasSubstr("is a pipe"));
  EXPECT_EQ(refusal(pipe, Pipes::read), "read: ");  // nobody writes to it
}

TEST_F(TextFile, APipeOfTheShellIsReadToItsEnd) {
  int ends[2];
  ASSERT_EQ(pipe2(ends, O_CLOEXEC), 0);
  std::jthread slow([&] {
    for (const auto* part : {"one ", "two ", "three"}) {
      usleep(20'000);
      EXPECT_GT(write(ends[1], part, std::string_view(part).size()), 0);
    }
    close(ends[1]);
  });
  EXPECT_EQ(read_text_file("/dev/fd/" + std::to_string(ends[0]), 1000, ErrorCode::bad_model, Pipes::read),
            "one two three");
  close(ends[0]);
}

}  // namespace
}  // namespace ferrobench
