// Recordings with every set of channels, and those of other programs: read here and with h5py alike.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdio>
#include <fstream>
#include <sstream>

#include "base/error.h"
#include "recordings/file/reader.h"
#include "recordings/file/writer.h"
#include "tests/recordings/sample.h"

namespace ferrobench::recordings {
namespace {

using testing::TemporaryFolder;

struct Said {
  int code = 0;
  std::vector<std::string> lines;
};

Said run_h5py(const std::string& arguments, const TemporaryFolder& folder) {
  const auto out = folder.file("said");
  const int status =
      std::system((FERROBENCH_PYTHON " " FERROBENCH_H5PY_FILES " " + arguments + " > " + out).c_str());
  Said said{WIFEXITED(status) ? WEXITSTATUS(status) : -1, {}};
  std::ifstream in(out);
  for (std::string line; std::getline(in, line);) said.lines.push_back(line);
  return said;
}

// A bench measures some of the channels; a recording has the command, the field, or both.
std::vector<std::vector<Channel>> sets_of_channels() {
  std::vector<std::vector<Channel>> out;
  for (unsigned bits = 1; bits < 32; ++bits) {
    if ((bits & 3) == 0) continue;
    auto& set = out.emplace_back();
    for (const auto channel : all_channels)
      if ((bits >> static_cast<unsigned>(channel) & 1) != 0) set.push_back(channel);
  }
  return out;
}

TEST(Channels, EverySetIsWrittenAndReadBack) {
  const TemporaryFolder folder;
  const auto program = testing::play(0, {{1e6, 1}, {1e6, 1}, {0, 1}}, 200);
  std::string files;
  std::vector<std::string> expected;
  for (const auto& set : sets_of_channels()) {
    std::vector<RawColumn> raw;
    std::vector<std::string> names;
    for (const auto channel : set) {
      names.emplace_back(channel_name(channel));
      if (channel != Channel::command) raw.push_back({channel, 2.0 + static_cast<double>(channel), 0.5});
    }
    std::ranges::sort(names);
    expected.emplace_back();
    for (const auto& name : names) expected.back() += (expected.back().empty() ? "" : " ") + name;
    SCOPED_TRACE(expected.back());

    std::vector<double> values(program.size());
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<double>(i % 77);
    const std::vector<std::int16_t> counts(program.size() * raw.size(), 5);
    Rows rows{.time = program.time, .channels = {}, .counts = counts};
    for (const auto channel : set) rows.channels.at(static_cast<std::size_t>(channel)) = values;
    const auto path = folder.file(std::to_string(expected.size()) + ".h5");
    files += " " + path;
    Writer writer(path, program.header, set, raw);
    writer.append(rows);
    writer.add_event({1, "note", "here"});
    writer.finish("complete", "all of it", program.segments, {});

    const auto r = read_recording(path);
    EXPECT_EQ(r.time, program.time);
    for (const auto channel : all_channels) {
      const bool wanted = std::ranges::find(set, channel) != set.end();
      ASSERT_EQ(r.has(channel), wanted) << channel_name(channel);
      if (wanted) {
        EXPECT_EQ(r.at(channel), values) << channel_name(channel);
      }
    }
    ASSERT_EQ(r.raw.has_value(), !raw.empty());
    if (r.raw) {
      EXPECT_EQ(r.raw->counts, counts);
    }
    EXPECT_EQ(r.reason, "all of it");
    EXPECT_EQ(r.segments.size(), 3u);
    EXPECT_EQ(read_summary(path).channels, set);
  }
  ASSERT_EQ(expected.size(), 24u);
  const auto said = run_h5py("read" + files, folder);
  if (said.code == 77) GTEST_SKIP() << "there is no h5py here";
  EXPECT_EQ(said.code, 0);
  EXPECT_EQ(said.lines, expected);
}

TEST(Foreign, WhatH5pyWritesIsRead) {
  const TemporaryFolder folder;
  const auto said = run_h5py("make " + folder.file(""), folder);
  if (said.code == 77) GTEST_SKIP() << "there is no h5py here";
  ASSERT_EQ(said.code, 0);
  int read = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder.file(""))) {
    const auto path = entry.path().string();
    if (!path.ends_with(".h5")) continue;
    SCOPED_TRACE(entry.path().filename());
    if (path.ends_with("lzf.h5")) {  // packed by a filter of h5py's own
      EXPECT_THROW(read_recording(path), Error);
      continue;
    }
    ++read;
    const auto r = read_recording(path);
    EXPECT_EQ(r.header.title, "made with h5py");
    EXPECT_EQ(r.header.specimen.name, "a stack");
    EXPECT_EQ(r.header.specimen.layer_count, 100);
    ASSERT_EQ(r.size(), 2500u);
    EXPECT_EQ(r.time.back(), 2499);
    for (const auto& [channel, period] : {std::pair{Channel::field, 90},
                                          {Channel::charge, 80},
                                          {Channel::displacement, 50},
                                          {Channel::force, 20}})
      for (std::size_t i = 0; i < r.size(); ++i)
        ASSERT_EQ(r.at(channel)[i], static_cast<double>(i % static_cast<std::size_t>(period)));
    ASSERT_EQ(r.segments.size(), 2u);
    EXPECT_EQ(r.segments[1].kind, "hold");
    EXPECT_EQ(r.segments[1].end_sample, 2000);
    EXPECT_EQ(r.segments[0].level, 1000);
    ASSERT_EQ(r.events.size(), 1u);
    EXPECT_EQ(r.events[0].message, "by hand");
    const auto summary = read_summary(path);
    EXPECT_EQ(summary.rows, 2500u);
    EXPECT_EQ(summary.duration, 2499);
  }
  EXPECT_EQ(read, 21);
}

}  // namespace
}  // namespace ferrobench::recordings
