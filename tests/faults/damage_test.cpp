#include "tests/faults/damage.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <fstream>

#include "base/error.h"
#include "recordings/analysis/difference.h"
#include "recordings/file/reader.h"

namespace ferrobench::faults {
namespace {

class Damage : public testing::Test {
 protected:
  ~Damage() override { std::filesystem::remove_all(folder); }
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("damage-" + std::to_string(getpid()));
};

TEST_F(Damage, IsRefusedOrDoesNoHarm) {
  const auto figures = damage_files(500, 1, folder);
  EXPECT_THAT(figures.failures, testing::IsEmpty());
  for (std::size_t kind = 0; kind < figures.rows.size(); ++kind) {
    const auto& row = figures.rows.at(kind);
    EXPECT_EQ(row.files, 100);
    // A journal is read up to what is damaged, and refused only where its first record is hit, one in ten.
    const bool is_journal = static_cast<DamagedKind>(kind) == DamagedKind::journal;
    EXPECT_GT(row.refused, is_journal ? 3 : 10) << figures;
    EXPECT_GT(row.refused + row.replayed, 30) << figures;
  }
}

TEST_F(Damage, AFileWithoutChecksumsIsReadTheSame) {
  sound_files(folder);
  const auto a = recordings::read_recording(folder / "whole.h5");
  const auto b = recordings::read_recording(folder / "plain.h5");
  const auto difference = recordings::compare(a, b);
  for (const auto& column : difference.columns) EXPECT_TRUE(column.identical()) << column.dataset;
  EXPECT_TRUE(difference.tables.empty());
  EXPECT_EQ(a.header.protocol, b.header.protocol);
  EXPECT_EQ(a.header.title, b.header.title);
  EXPECT_EQ(a.raw->counts, b.raw->counts);
  const auto whole = recordings::read_summary(folder / "whole.h5");
  const auto plain = recordings::read_summary(folder / "plain.h5");
  EXPECT_EQ(plain.rows, a.size());
  EXPECT_EQ(plain.duration, whole.duration);
  EXPECT_EQ(plain.channels, whole.channels);
  EXPECT_EQ(plain.status, whole.status);
  EXPECT_EQ(plain.end_time, whole.end_time);
  EXPECT_EQ(plain.header.title, whole.header.title);
  EXPECT_EQ(plain.segment_count, whole.segment_count);
  EXPECT_EQ(plain.event_count, whole.event_count);
}

// Chunks without a dimension: the library divides by nothing.
TEST_F(Damage, WhatTheLibraryCrashesOverIsAnError) {
  auto bytes = sound_files(folder)[static_cast<std::size_t>(DamagedKind::plain_recording)];
  const std::string chunked("\3\2\2", 3), rows("\x40\0\0\0\x8\0\0\0", 8);
  int zeroed = 0;
  for (auto at = bytes.find(chunked); at != std::string::npos; at = bytes.find(chunked, at + 1))
    if (bytes.compare(at + 11, rows.size(), rows) == 0) bytes[at + 2] = '\0', ++zeroed;
  ASSERT_GE(zeroed, 4);
  const auto path = (folder / "zero.h5").string();
  std::ofstream(path, std::ios::binary) << bytes;
  try {
    recordings::read_recording(path);
    FAIL() << "was read";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::bad_recording);
    EXPECT_THAT(error.what(), testing::HasSubstr("crash"));
  }
  // Among others it is the only one that is called damaged.
  const auto whole = (folder / "whole.h5").string();
  const auto read = recordings::read_summaries(std::vector{whole, path, whole, path, whole});
  for (std::size_t i = 0; i < read.size(); ++i)
    EXPECT_EQ(std::holds_alternative<recordings::Summary>(read[i]), i % 2 == 0) << i;
}

}  // namespace
}  // namespace ferrobench::faults
