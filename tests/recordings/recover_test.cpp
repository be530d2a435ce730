// Runs that broke off: journals cut at any byte, damaged anywhere, left by a power cut, or made to mislead.
#include "recordings/file/recover.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <random>

#include "base/error.h"
#include "recordings/file/reader.h"
#include "recordings/file/writer.h"
#include "recordings/format/texts.h"
#include "recordings/journal/reader.h"
#include "recordings/journal/records.h"
#include "recordings/journal/writer.h"
#include "tests/recordings/sample.h"

namespace ferrobench::recordings {
namespace {

using ::testing::HasSubstr;
using testing::TemporaryFolder;

constexpr std::size_t block = 20;  // rows

Recording sample() {
  auto r = testing::play(0, {{1e6, 1}, {1e6, 1}, {0, 1}}, 200);
  r.set(Channel::charge).assign(r.size(), 1e-4);
  r.set(Channel::displacement) = r.time;
  r.channels.at(static_cast<std::size_t>(Channel::displacement))->at(7) = std::nan("");
  r.raw = Raw{.columns = {{Channel::field, 30.5, 0}, {Channel::charge, 1e-8, 1e-6}}, .counts = {}};
  for (std::size_t i = 0; i < 2 * r.size(); ++i) r.raw->counts.push_back(static_cast<std::int16_t>(i));
  return r;
}

std::vector<Channel> channels_of(const Recording& r) {
  std::vector<Channel> out;
  for (const auto channel : all_channels)
    if (r.has(channel)) out.push_back(channel);
  return out;
}

void append(Writer& writer, const Recording& r, std::size_t first, std::size_t count) {
  Rows rows{.time = std::span(r.time).subspan(first, count), .channels = {}, .counts = {}};
  for (const auto channel : channels_of(r))
    rows.channels.at(static_cast<std::size_t>(channel)) = std::span(r.at(channel)).subspan(first, count);
  rows.counts = std::span(r.raw->counts).subspan(2 * first, 2 * count);
  writer.append(rows);
}

// Leaves a run as the death of the program would; an event comes after the second block.
void leave(const std::string& path, const Recording& r, std::size_t rows) {
  Writer writer(path, r.header, channels_of(r), r.raw->columns);
  for (std::size_t done = 0; done < rows; done += block) {
    append(writer, r, done, block);
    if (done == block) writer.add_event({0.15, "note", "späte Notiz"});
  }
}

std::string slurp(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void spill(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

void expect_part(const Recording& part, const Recording& whole, std::size_t rows) {
  ASSERT_EQ(part.size(), rows);
  EXPECT_TRUE(std::equal(part.time.begin(), part.time.end(), whole.time.begin()));
  for (const auto channel : all_channels) {
    ASSERT_EQ(part.has(channel), whole.has(channel));
    for (std::size_t i = 0; part.has(channel) && i < rows; ++i) {
      const double a = part.at(channel)[i], b = whole.at(channel)[i];
      ASSERT_TRUE(a == b || (std::isnan(a) && std::isnan(b))) << channel_name(channel) << ' ' << i;
    }
  }
  ASSERT_TRUE(part.raw);
  EXPECT_TRUE(std::equal(part.raw->counts.begin(), part.raw->counts.end(), whole.raw->counts.begin()));
}

bool has_event(const Recording& r, const std::string& kind) {
  return std::ranges::any_of(r.events, [&](const auto& event) { return event.kind == kind; });
}

TEST(Recover, WhatWasRecordedBecomesTheFileAndTheGapIsStated) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.h5");
  const auto whole = sample();
  leave(path, whole, 300);
  EXPECT_EQ(read_summary(path).status, "broken_off");
  EXPECT_EQ(read_recording(path).status, "broken_off");
  EXPECT_THAT(read_summary(path).reason, HasSubstr("ferrobench recover"));
  EXPECT_EQ(find_broken(folder.file("")), std::vector{path});

  const auto done = recover_recording(path);
  EXPECT_EQ(done.outcome, Recovered::recovered);
  EXPECT_EQ(done.rows, 300u);
  EXPECT_EQ(done.bytes_lost, 0u);
  const auto r = read_recording(path);
  expect_part(r, whole, 300);
  EXPECT_EQ(r.status, "recovered");
  EXPECT_THAT(r.reason, HasSubstr("1.495 s"));
  EXPECT_EQ(r.end_time, "2026-01-01T00:00:01.495000Z");
  EXPECT_EQ(r.header.entry_identifier, whole.header.entry_identifier);
  ASSERT_EQ(r.events.size(), 2u);
  EXPECT_EQ(r.events[0].message, "späte Notiz");
  EXPECT_EQ(r.events[1].kind, "gap");
  EXPECT_DOUBLE_EQ(r.events[1].time, r.time.back());

  const auto bytes = slurp(path);
  EXPECT_EQ(recover_recording(path).outcome, Recovered::already_whole);
  EXPECT_EQ(slurp(path), bytes);
  EXPECT_TRUE(find_broken(folder.file("")).empty());
}

TEST(Recover, ARunUnderWayIsLeftAlone) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.h5");
  const auto whole = sample();
  Writer writer(path, whole.header, channels_of(whole), whole.raw->columns);
  append(writer, whole, 0, 100);
  EXPECT_EQ(recover_recording(path).outcome, Recovered::running);
  EXPECT_EQ(journal_state(path), JournalState::being_written);
  EXPECT_EQ(read_summary(path).status, "running");
  EXPECT_EQ(read_summary(path).reason, "");
  EXPECT_THROW(remove_recording(path), Error);
  append(writer, whole, 100, 100);
  EXPECT_EQ(read_recording(path).size(), 200u);
  writer.finish("complete", "", whole.segments, {});
  EXPECT_EQ(journal_state(path), JournalState::none);
  expect_part(read_recording(path), whole, 200);
  EXPECT_EQ(read_recording(path).segments.back().end_sample, 200);  // none leaves the rows that there are
}

TEST(Recover, AJournalCutAnywhereGivesAllThatIsWhole) {
  const TemporaryFolder folder;
  const auto whole = sample();
  leave(folder.file("a.h5"), whole, 100);
  const auto journal = slurp(folder.file("a.h5.journal"));
  const auto path = folder.file("cut.h5");
  std::size_t least = 0;
  for (std::size_t length = 0; length <= journal.size(); length += length + 97 < journal.size() ? 97 : 1) {
    spill(path + ".journal", journal.substr(0, length));
    const auto done = recover_recording(path);
    EXPECT_FALSE(std::filesystem::exists(path + ".journal")) << length;
    EXPECT_GE(done.rows, least) << length;
    EXPECT_EQ(done.rows % block, 0u);
    least = done.rows;
    if (done.outcome == Recovered::nothing) {
      EXPECT_EQ(done.rows, 0u);
      EXPECT_FALSE(std::filesystem::exists(path));
      continue;
    }
    expect_part(read_recording(path), whole, done.rows);
    std::filesystem::remove(path);
  }
  EXPECT_EQ(least, 100u);
}

// What had been synced is there whatever became of the pages after it.
TEST(Recover, APowerCutCostsNothingThatWasOnTheDisk) {
  const TemporaryFolder folder;
  const auto whole = sample();
  std::size_t synced = 0;
  const auto path = folder.file("a.h5");
  {
    Writer writer(path, whole.header, channels_of(whole), whole.raw->columns);
    append(writer, whole, 0, 200);
    writer.flush();
    EXPECT_EQ(writer.rows_on_disk(), 200u);
    EXPECT_EQ(writer.waiting().count(), 0);
    synced = std::filesystem::file_size(path + ".journal");
    for (std::size_t done = 200; done < 400; done += block) append(writer, whole, done, block);
  }
  const auto journal = slurp(path + ".journal");
  std::mt19937_64 random(3);
  for (int i = 0; i < 40; ++i) {
    auto bytes = journal.substr(0, synced + random() % (journal.size() - synced + 1));
    for (std::size_t page = synced; page < bytes.size(); page += 512)
      if (random() % 2 == 0)
        for (std::size_t j = page; j < std::min(bytes.size(), page + 512); ++j)
          bytes[j] = i % 2 == 0 ? '\0' : static_cast<char>(random());
    const auto cut = folder.file("cut" + std::to_string(i) + ".h5");
    spill(cut + ".journal", bytes);
    const auto done = recover_recording(cut);
    EXPECT_GE(done.rows, 200u);
    expect_part(read_recording(cut), whole, done.rows);
  }
}

TEST(Recover, DamageIsCutOffSaidAndKeptAside) {
  const TemporaryFolder folder;
  const auto whole = sample();
  const auto path = folder.file("a.h5");
  leave(path, whole, 300);
  auto bytes = slurp(path + ".journal");
  bytes[bytes.size() / 2] ^= 4;
  spill(path + ".journal", bytes);
  const auto done = recover_recording(path);
  EXPECT_EQ(done.outcome, Recovered::recovered);
  EXPECT_LT(done.rows, 300u);
  EXPECT_GT(done.bytes_lost, 0u);
  EXPECT_THAT(done.message, HasSubstr("damaged"));
  const auto r = read_recording(path);
  expect_part(r, whole, done.rows);
  EXPECT_TRUE(has_event(r, "damage"));
  EXPECT_EQ(slurp(path + ".journal.damaged"), bytes);
  EXPECT_EQ(recover_recording(path).outcome, Recovered::already_whole);

  remove_recording(path);
  leave(path, whole, 300);
  auto others = slurp(path + ".journal");
  others[others.size() / 3] ^= 4;
  spill(path + ".journal", others);
  EXPECT_THAT(recover_recording(path).message, HasSubstr("a.h5.journal.damaged-2"));
  EXPECT_EQ(slurp(path + ".journal.damaged"), bytes);
  EXPECT_EQ(slurp(path + ".journal.damaged-2"), others);
}

// The program died after the last sample, while the file was made or before the journal was gone.
TEST(Recover, AClosedRunKeepsItsStatus) {
  const TemporaryFolder folder;
  const auto whole = sample();
  const auto path = folder.file("a.h5");
  {
    Begin begin{whole.header, channels_of(whole), whole.raw->columns};
    JournalWriter journal(journal_path(path), begin);
    Rows rows{.time = whole.time, .channels = {}, .counts = whole.raw->counts};
    for (const auto channel : begin.channels)
      rows.channels.at(static_cast<std::size_t>(channel)) = whole.at(channel);
    journal.append(rows);
    journal.append(Ending{"2026-01-01T00:00:03Z", "aborted", "enough", whole.segments, {std::nullopt, 1.5}});
  }
  const auto journal = slurp(path + ".journal");
  EXPECT_EQ(read_summary(path).status, "aborted");
  EXPECT_EQ(read_recording(path).segments.size(), 3u);
  EXPECT_EQ(recover_recording(path).outcome, Recovered::completed);
  const auto r = read_recording(path);
  expect_part(r, whole, whole.size());
  EXPECT_EQ(r.status, "aborted");
  EXPECT_EQ(r.reason, "enough");
  EXPECT_EQ(r.segments.size(), 3u);
  EXPECT_EQ(r.noise.at(1), 1.5);
  EXPECT_TRUE(has_event(r, "recovered"));

  spill(path + ".journal", journal);  // beside the whole file
  EXPECT_EQ(recover_recording(path + ".journal").outcome, Recovered::already_whole);
  EXPECT_FALSE(std::filesystem::exists(path + ".journal"));
}

// The disk was full for a while: the run is closed, and knows how much it could not record.
TEST(Recover, WhatCouldNotBeRecordedIsStated) {
  const TemporaryFolder folder;
  const auto whole = sample();
  const auto path = folder.file("a.h5");
  {
    Begin begin{whole.header, channels_of(whole), whole.raw->columns};
    JournalWriter journal(journal_path(path), begin);
    Rows rows{.time = std::span(whole.time).first(300), .channels = {}, .counts = {}};
    for (const auto channel : begin.channels)
      rows.channels.at(static_cast<std::size_t>(channel)) = std::span(whole.at(channel)).first(300);
    rows.counts = std::span(whole.raw->counts).first(300 * begin.raw.size());
    journal.append(rows);
    journal.append(Ending{"2026-01-01T00:00:03Z", "aborted", "no space", whole.segments, {}, 100});
  }
  EXPECT_EQ(read_recording(path).segments.back().end_sample, 300);  // none leaves the rows that there are
  const auto done = recover_recording(path);
  EXPECT_EQ(done.outcome, Recovered::completed);
  EXPECT_EQ(done.message, "300 samples, 100 missing at the end");
  const auto r = read_recording(path);
  expect_part(r, whole, 300);
  ASSERT_TRUE(has_event(r, "gap"));
  EXPECT_THAT(r.events.back().message, HasSubstr("100 of 400 samples are missing"));
  for (const auto& event : r.events) EXPECT_THAT(event.message, Not(HasSubstr("nothing is missing")));
}

TEST(Recover, RowsThatCouldNotBeAppendedAreStatedInTheFile) {
  const TemporaryFolder folder;
  const auto whole = sample();
  const auto path = folder.file("a.h5");
  Writer writer(path, whole.header, channels_of(whole), whole.raw->columns);
  append(writer, whole, 0, 300);
  writer.finish("aborted", "no space", whole.segments, {}, 400);
  const auto r = read_recording(path);
  expect_part(r, whole, 300);
  ASSERT_FALSE(r.events.empty());
  EXPECT_EQ(r.events.back().kind, "gap");
  EXPECT_THAT(r.events.back().message, HasSubstr("100 of 400 samples are missing"));
}

// Somebody tidies up while a run goes on.
class JournalTakenAway : public ::testing::TestWithParam<bool> {};

TEST_P(JournalTakenAway, IsNoticedAndCostsNothing) {
  const TemporaryFolder folder;
  const auto whole = sample();
  const auto path = folder.file("a.h5"), journal = path + ".journal", moved = folder.file("moved");
  Writer writer(path, whole.header, channels_of(whole), whole.raw->columns);
  append(writer, whole, 0, 200);
  writer.flush();
  EXPECT_TRUE(writer.is_in_place());
  EXPECT_EQ(writer.rows_on_disk(), 200u);
  if (GetParam())
    std::filesystem::rename(journal, moved);
  else
    std::filesystem::remove(journal);
  spill(journal, "somebody else's");
  append(writer, whole, 200, 100);
  writer.flush();
  EXPECT_FALSE(writer.is_in_place());
  EXPECT_EQ(writer.rows_on_disk(), 0u);
  append(writer, whole, 300, 100);
  writer.finish("aborted", "it was taken away", whole.segments, {});
  expect_part(read_recording(path), whole, 400);
  EXPECT_EQ(slurp(journal), "somebody else's");
  EXPECT_EQ(std::filesystem::exists(moved), GetParam());
}
INSTANTIATE_TEST_SUITE_P(Each, JournalTakenAway, ::testing::Bool(),
                         [](const auto& each) { return each.param ? "Renamed" : "Removed"; });

TEST(Recover, NeverReplacesAnotherRecording) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.h5");
  auto whole = sample();
  leave(path, whole, 100);
  whole.header.entry_identifier = "another";
  write_recording(path, whole);
  try {
    recover_recording(path);
    FAIL() << "replaced it";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::busy);
    EXPECT_THAT(error.what(), HasSubstr("another name"));
  }
  EXPECT_EQ(read_recording(path).header.entry_identifier, "another");
  EXPECT_EQ(journal_state(path), JournalState::left);
  EXPECT_THROW(Writer(folder.file("a.h5"), whole.header, all_channels), Error);
}

TEST(Recover, SaysWhatIsNotThere) {
  const TemporaryFolder folder;
  EXPECT_THROW(recover_recording(folder.file("none.h5")), Error);
  EXPECT_THROW(find_broken(folder.file("none")), Error);
  spill(folder.file("text.h5.journal"), std::string(1000, 'x'));
  try {
    recover_recording(folder.file("text.h5"));
    FAIL() << "recovered it";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::bad_recording);
  }
  EXPECT_TRUE(std::filesystem::exists(folder.file("text.h5.journal")));
}

// Reads, recovers or refuses; what comes out are the first rows and nothing else, or bad_recording.
TEST(HostileJournal, FlippedAndCutBytesAreRecoveredOrRefused) {
  const TemporaryFolder folder;
  const auto whole = sample();
  leave(folder.file("a.h5"), whole, 400);
  const auto good = slurp(folder.file("a.h5.journal"));
  const auto path = folder.file("bad.h5");
  std::mt19937_64 random(4);
  int refused = 0, cut = 0;
  for (int i = 0; i < 400; ++i) {
    auto bytes = good.substr(0, i % 3 == 0 ? random() % good.size() : good.size());
    for (int flips = i % 4; flips > 0 && !bytes.empty(); --flips)
      bytes[random() % std::min<std::size_t>(bytes.size(), i % 5 == 0 ? 100 : bytes.size())] ^=
          static_cast<char>(1 << (random() % 8));
    spill(path + ".journal", bytes);
    try {
      const auto done = recover_recording(path);
      cut += done.rows < 400 ? 1 : 0;
      if (done.outcome != Recovered::nothing) expect_part(read_recording(path), whole, done.rows);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::bad_recording) << error.what();
      ++refused;
    }
    for (const auto* end : {"", ".journal", ".journal.damaged"}) std::filesystem::remove(path + end);
  }
  EXPECT_GT(refused, 0);
  EXPECT_GT(cut, 100);
}

// Checksums are right, what they stand for is not.
TEST(HostileJournal, RecordsThatDoNotFitAreRefusedOrCut) {
  const TemporaryFolder folder;
  const auto whole = sample();
  const Begin begin{whole.header, {Channel::field}, {}};
  const auto first = encode(RecordKind::begin, 0, 0, begin_text(begin));
  const std::string rows(16 * 3, '\0');
  const auto path = folder.file("x.h5");
  const std::vector<std::string> journals{
      encode(RecordKind::rows, 0, 3, rows),
      encode(RecordKind::begin, 0, 0, "{}"),
      encode(RecordKind::begin, 0, 0, "[[[["),
      encode(RecordKind::begin, 0, 0, std::string(100000, '[')),
      first + encode(RecordKind::rows, 1, 4, rows),
      first + encode(RecordKind::rows, 1, 0xffffffff, rows),
      first + encode(RecordKind::rows, 2, 3, rows),
      first + encode(RecordKind::begin, 1, 0, begin_text(begin)),
      first + encode(RecordKind::event, 1, 0, R"({"time": "now"})"),
      first + encode(RecordKind::end, 1, 0, R"({"end_time": "", "status": 7})"),
      first + encode(RecordKind::rows, 1, 3, rows),  // time stands still
  };
  for (std::size_t i = 0; i < journals.size(); ++i) {
    spill(path + ".journal", journals[i]);
    try {
      EXPECT_EQ(read_recording(path).size(), 0u) << i;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::bad_recording) << i << error.what();
    }
  }
}

TEST(JournalFormat, BeginAndEndComeBackAsTheyWere) {
  auto whole = sample();
  whole.header.run_seed = -7;
  whole.header.model = {{"name", "a"}, {"value", 0.1}};
  whole.header.charge_reference = ChargeReference::first_sample;
  const auto begin =
      begin_of(begin_text({whole.header, {Channel::charge, Channel::command}, whole.raw->columns}));
  EXPECT_EQ(begin.header.run_seed, -7);
  EXPECT_EQ(begin.header.model, whole.header.model);
  EXPECT_EQ(begin.header.protocol, whole.header.protocol);
  EXPECT_EQ(begin.header.charge_reference, ChargeReference::first_sample);
  EXPECT_EQ(begin.header.specimen.area, whole.header.specimen.area);
  EXPECT_EQ(begin.header.load.prestress, whole.header.load.prestress);
  EXPECT_EQ(begin.channels, (std::vector{Channel::charge, Channel::command}));
  EXPECT_EQ(begin.raw[1].gain, 1e-8);
  EXPECT_EQ(begin.row_bytes(), 28u);
  const auto end =
      ending_of(ending_text({"then", "complete", "", whole.segments, {std::nullopt, std::nullopt, 3e-9}}));
  EXPECT_EQ(end.noise.at(2), 3e-9);
  EXPECT_FALSE(end.noise.at(1));
  ASSERT_EQ(end.segments.size(), whole.segments.size());
  EXPECT_EQ(end.segments[1].level, whole.segments[1].level);
}

}  // namespace
}  // namespace ferrobench::recordings
