#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "recordings/file/reader.h"
#include "recordings/file/writer.h"
#include "tests/recordings/sample.h"

namespace ferrobench::recordings {
namespace {

using testing::play;
using testing::TemporaryFolder;

Recording full_recording() {
  auto r = play(0, {{1e6, 2}, {1e6, 3}, {-5e5, 1.5}}, 4000);
  auto& charge = r.set(Channel::charge);
  auto& displacement = r.set(Channel::displacement);
  auto& force = r.set(Channel::force);
  Raw raw{.columns = {{Channel::field, 30.5, 0}, {Channel::charge, 1e-8, 1e-6}}, .counts = {}};
  for (std::size_t i = 0; i < r.size(); ++i) {
    charge.push_back(1e-9 * r.at(Channel::field)[i]);
    displacement.push_back(8e-12 * r.at(Channel::field)[i] + 1e-9 * std::sin(r.time[i]));
    force.push_back(200 + 2.7e6 * displacement.back());
    raw.counts.push_back(static_cast<std::int16_t>(i % 30000));
    raw.counts.push_back(static_cast<std::int16_t>(-static_cast<int>(i % 20000)));
  }
  displacement[11] = std::nan("");
  r.raw = std::move(raw);
  r.events = {{0.5, "gap", "one sample lost"}, {1.25, "note", "änderung <b>"}};
  r.header.past = {
      protocols::PastKind::visited, protocols::FirstState::partly_poled, {{-1.5e6, 2}, {0, 1.5}}, -0.4};
  r.noise.at(2) = 3e-9;
  r.end_time = "2026-01-01T00:00:06.500000Z";
  r.reason = "all of it";
  return r;
}

void expect_equal(const std::vector<double>& a, const std::vector<double>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i)
    ASSERT_TRUE(a[i] == b[i] || (std::isnan(a[i]) && std::isnan(b[i]))) << "at " << i;
}

void expect_equal(const Recording& a, const Recording& b) {
  EXPECT_EQ(a.header.title, b.header.title);
  EXPECT_EQ(a.header.start_time, b.header.start_time);
  EXPECT_EQ(a.header.entry_identifier, b.header.entry_identifier);
  EXPECT_EQ(a.header.run_seed, b.header.run_seed);
  EXPECT_EQ(a.header.protocol, b.header.protocol);
  EXPECT_EQ(a.header.model, b.header.model);
  EXPECT_EQ(a.header.device, b.header.device);
  EXPECT_EQ(a.header.specimen.name, b.header.specimen.name);
  EXPECT_EQ(a.header.specimen.length, b.header.specimen.length);
  EXPECT_EQ(a.header.specimen.layer_count, b.header.specimen.layer_count);
  EXPECT_EQ(a.header.load.prestress, b.header.load.prestress);
  EXPECT_EQ(a.header.past, b.header.past);
  EXPECT_EQ(a.header.charge_reference, b.header.charge_reference);
  EXPECT_EQ(a.end_time, b.end_time);
  EXPECT_EQ(a.status, b.status);
  EXPECT_EQ(a.reason, b.reason);
  expect_equal(a.time, b.time);
  for (const auto channel : all_channels) {
    ASSERT_EQ(a.has(channel), b.has(channel)) << channel_name(channel);
    if (a.has(channel)) expect_equal(a.at(channel), b.at(channel));
  }
  ASSERT_EQ(a.segments.size(), b.segments.size());
  for (std::size_t i = 0; i < a.segments.size(); ++i) {
    EXPECT_EQ(a.segments[i].start_sample, b.segments[i].start_sample);
    EXPECT_EQ(a.segments[i].end_sample, b.segments[i].end_sample);
    EXPECT_EQ(a.segments[i].kind, b.segments[i].kind);
    EXPECT_EQ(a.segments[i].label, b.segments[i].label);
    EXPECT_EQ(a.segments[i].level, b.segments[i].level);
    EXPECT_EQ(a.segments[i].rate, b.segments[i].rate);
  }
  ASSERT_EQ(a.events.size(), b.events.size());
  for (std::size_t i = 0; i < a.events.size(); ++i) EXPECT_EQ(a.events[i].message, b.events[i].message);
  EXPECT_EQ(a.noise, b.noise);
  ASSERT_EQ(a.raw.has_value(), b.raw.has_value());
  if (a.raw) {
    EXPECT_EQ(a.raw->counts, b.raw->counts);
    ASSERT_EQ(a.raw->columns.size(), b.raw->columns.size());
    EXPECT_EQ(a.raw->columns[1].gain, b.raw->columns[1].gain);
    EXPECT_EQ(a.raw->columns[1].offset, b.raw->columns[1].offset);
    EXPECT_EQ(a.raw->columns[1].channel, b.raw->columns[1].channel);
  }
}

Rows slice(const Recording& r, std::size_t first, std::size_t count) {
  Rows rows;
  rows.time = std::span(r.time).subspan(first, count);
  for (const auto channel : all_channels)
    if (r.has(channel))
      rows.channels.at(static_cast<std::size_t>(channel)) = std::span(r.at(channel)).subspan(first, count);
  if (r.raw) rows.counts = std::span(r.raw->counts).subspan(2 * first, 2 * count);
  return rows;
}

TEST(File, WrittenInOneGoReadsBackTheSame) {
  const TemporaryFolder folder;
  const auto r = full_recording();
  write_recording(folder.file("a.h5"), r);
  expect_equal(r, read_recording(folder.file("a.h5")));
  const auto summary = read_summary(folder.file("a.h5"));
  EXPECT_EQ(summary.rows, r.size());
  EXPECT_DOUBLE_EQ(summary.duration, 6.5);
  EXPECT_EQ(summary.channels.size(), 5u);
  EXPECT_EQ(summary.segment_count, 3u);
  EXPECT_EQ(summary.event_count, 2u);
}

TEST(File, WrittenInPiecesReadsBackTheSame) {
  const TemporaryFolder folder;
  const auto r = full_recording();
  const auto path = folder.file("b.h5");
  {
    Writer writer(path, r.header, all_channels, r.raw->columns);
    std::size_t done = 0;
    for (std::size_t piece = 1; done < r.size(); piece = piece * 3 + 1) {
      const auto count = std::min(piece, r.size() - done);
      writer.append(slice(r, done, count));
      done += count;
      if (piece < 1000) writer.flush();
    }
    for (const auto& event : r.events) writer.add_event(event);
    EXPECT_EQ(writer.rows(), r.size());
    writer.finish(r.status, r.reason, r.segments, r.noise);
  }
  expect_equal(r, read_recording(path));
}

TEST(File, CanBeReadWhileItIsWrittenAndAfterItWasLeft) {
  const TemporaryFolder folder;
  const auto r = full_recording();
  const auto path = folder.file("c.h5");
  const std::array<Channel, 2> channels{Channel::field, Channel::displacement};
  {
    Writer writer(path, r.header, channels);
    Rows rows = slice(r, 0, 10000);
    rows.counts = {};
    writer.append(rows);
    writer.flush();
    std::filesystem::copy_file(path + ".journal",
                               folder.file("crashed.h5.journal"));  // what a crash would leave
    const auto half = read_recording(path);
    EXPECT_EQ(half.status, "running");
    EXPECT_EQ(half.size(), 10000u);
    EXPECT_FALSE(half.has(Channel::charge));
    writer.append({.time = std::span(r.time).subspan(10000, 5),
                   .channels = {std::span<const double>{},
                                std::span(r.at(Channel::field)).subspan(10000, 5),
                                {},
                                std::span(r.at(Channel::displacement)).subspan(10000, 5),
                                {}},
                   .counts = {}});
  }
  EXPECT_EQ(read_recording(path).size(), 10005u);
  EXPECT_EQ(read_recording(folder.file("crashed.h5")).size(), 10000u);
}

TEST(File, NeverOverwritesARun) {
  const TemporaryFolder folder;
  const auto path = folder.file("d.h5");
  write_recording(path, full_recording());
  try {
    Writer writer(path, testing::sample_header(), all_channels);
    FAIL() << "overwrote";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::busy);
    EXPECT_THAT(error.what(), ::testing::HasSubstr("another name"));
  }
  EXPECT_EQ(read_recording(path).size(), full_recording().size());
}

TEST(File, EmptyRunIsARecording) {
  const TemporaryFolder folder;
  const auto path = folder.file("e.h5");
  Writer writer(path, testing::sample_header(), all_channels);
  writer.finish("aborted", "nothing came", {}, {});
  const auto r = read_recording(path);
  EXPECT_EQ(r.size(), 0u);
  EXPECT_EQ(r.status, "aborted");
  EXPECT_EQ(r.reason, "nothing came");
  EXPECT_EQ(r.end_time, "2026-01-01T00:00:00.000000Z");
}

TEST(File, MissingFileAndFolderSayWhich) {
  try {
    read_recording("/nowhere/at/all.h5");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::not_found);
  }
  try {
    write_recording("/nowhere/at/all.h5", full_recording());
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::io_error);
    EXPECT_THAT(error.what(), ::testing::HasSubstr("/nowhere/at/all.h5"));
  }
}

}  // namespace
}  // namespace ferrobench::recordings
