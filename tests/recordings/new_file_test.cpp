// Files that take their name when they are whole, and recordings that several change at once.
#include "recordings/disk/new_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <thread>

#include "recordings/file/reader.h"
#include "recordings/file/recover.h"
#include "recordings/file/writer.h"
#include "tests/recordings/sample.h"

namespace ferrobench::recordings {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::TemporaryFolder;

std::string text_of(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

void put(const std::string& path, const std::string& text, Existing existing = Existing::replace) {
  NewFile file(path, existing);
  file.write(text);
  file.put();
}

std::vector<std::string> names_in(const std::string& folder) {
  std::vector<std::string> out;
  for (const auto& entry : fs::directory_iterator(folder)) out.push_back(entry.path().filename().string());
  std::ranges::sort(out);
  return out;
}

template <class F>
std::string refusal(F&& act) {
  try {
    act();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was refused";
}

TEST(NewFile, WithoutPutEverythingIsAsItWas) {
  const TemporaryFolder folder;
  put(folder.file("a"), "before");
  {
    NewFile file(folder.file("a"), Existing::replace);
    file.write("half of wh");
    EXPECT_EQ(text_of(folder.file("a")), "before");
  }
  EXPECT_EQ(text_of(folder.file("a")), "before");
  EXPECT_EQ(names_in(folder.file("")), std::vector<std::string>{"a"});
  put(folder.file("a"), "after");
  EXPECT_EQ(text_of(folder.file("a")), "after");
  EXPECT_EQ(names_in(folder.file("")), std::vector<std::string>{"a"});
}

TEST(NewFile, WhoCouldReadTheOldOneCanReadTheNewAndNobodyElse) {
  const TemporaryFolder folder;
  put(folder.file("a"), "before");
  fs::permissions(folder.file("a"), fs::perms::owner_read | fs::perms::owner_write);
  put(folder.file("a"), "after");
  EXPECT_EQ(fs::status(folder.file("a")).permissions(), fs::perms::owner_read | fs::perms::owner_write);
}

TEST(NewFile, WhatIsToBeKeptIsKept) {
  const TemporaryFolder folder;
  put(folder.file("a"), "before");
  EXPECT_THROW(NewFile(folder.file("a"), Existing::keep), NameTaken);
  NewFile late(folder.file("b"), Existing::keep);  // the name goes to somebody else in between
  late.write("late");
  put(folder.file("b"), "first");
  EXPECT_THROW(late.put(), NameTaken);
  EXPECT_EQ(text_of(folder.file("a")), "before");
  EXPECT_EQ(text_of(folder.file("b")), "first");
}

TEST(NewFile, OneOfManyGetsTheName) {
  const TemporaryFolder folder;
  for (int round = 0; round < 20; ++round) {
    const auto path = folder.file(std::to_string(round));
    std::atomic<int> got = 0;
    std::string winner;
    {
      std::vector<std::jthread> all;
      for (int i = 0; i < 8; ++i)
        all.emplace_back([&, text = std::string(1000, static_cast<char>('a' + i))] {
          try {
            put(path, text, Existing::keep);
            ++got;
            winner = text;
          } catch (const NameTaken&) {
          }
        });
    }
    EXPECT_EQ(got, 1);
    EXPECT_EQ(text_of(path), winner);
  }
}

TEST(NewFile, OnlyRegularFilesAreReplaced) {
  const TemporaryFolder folder;
  put(folder.file("precious"), "precious");
  fs::create_symlink(folder.file("precious"), folder.file("link"));
  fs::create_symlink(folder.file("nowhere"), folder.file("dangling"));
  fs::create_directory(folder.file("folder"));
  ASSERT_EQ(mkfifo(folder.file("pipe").c_str(), 0600), 0);
  const auto before = names_in(folder.file(""));
  const std::vector<std::pair<std::string, std::string>> kinds{{folder.file("link"), "symbolic link"},
                                                               {folder.file("dangling"), "symbolic link"},
                                                               {folder.file("folder"), "folder"},
                                                               {folder.file("pipe"), "pipe"},
                                                               {"/dev/null", "device"}};
  for (const auto& [path, kind] : kinds)
    for (const auto existing : {Existing::keep, Existing::replace}) {
      EXPECT_THAT(refusal([&] { demand_place(path, existing); }), HasSubstr(kind));
      EXPECT_THAT(refusal([&] { put(path, "x", existing); }), HasSubstr(kind));
    }
  EXPECT_THAT(refusal([&] { put(folder.file("link"), "x"); }), HasSubstr(folder.file("precious")));
  EXPECT_EQ(names_in(folder.file("")), before);
  EXPECT_EQ(text_of(folder.file("precious")), "precious");
}

TEST(NewFile, ALinkThatComesLateIsNotFollowedEither) {
  const TemporaryFolder folder;
  put(folder.file("precious"), "precious");
  NewFile file(folder.file("a"), Existing::replace);
  file.write("x");
  fs::create_symlink(folder.file("precious"), folder.file("a"));
  EXPECT_THAT(refusal([&] { file.put(); }), HasSubstr("symbolic link"));
  EXPECT_EQ(text_of(folder.file("precious")), "precious");
}

TEST(NewFile, ASourceIsNeverReplacedWhateverItsNameLooksLike) {
  const TemporaryFolder folder;
  put(folder.file("a"), "source");
  fs::create_hard_link(folder.file("a"), folder.file("hard"));
  fs::create_directory(folder.file("b"));
  fs::create_directory_symlink(folder.file(""), folder.file("c"));
  const std::vector<std::string> sources{folder.file("not there"), folder.file("a")};
  for (const auto& name : {"a", "hard", "b/../a", "c/a"})
    EXPECT_THAT(refusal([&] { demand_place(folder.file(name), Existing::replace, sources); }),
                HasSubstr("replace its source"));
  put(folder.file("d"), "source");  // the same text is another file
  EXPECT_NO_THROW(demand_place(folder.file("d"), Existing::replace, sources));
  EXPECT_NO_THROW(demand_place(folder.file("new"), Existing::replace, sources));
}

TEST(NewFile, TheHintFitsWhatIsWrong) {
  const TemporaryFolder folder;
  put(folder.file("file"), "x");
  const auto said = [](const std::string& path) {
    return refusal([&] { demand_place(path, Existing::replace); });
  };
  EXPECT_THAT(said("/proc/x"), ::testing::AllOf(HasSubstr("another folder"), Not(HasSubstr("room"))));
  EXPECT_THAT(said(folder.file("none/x")), HasSubstr("make it"));
  EXPECT_THAT(said(folder.file("file/x")), HasSubstr("there is no folder"));
  EXPECT_THAT(said(folder.file(std::string(300, 'x'))), HasSubstr("shorter"));
  EXPECT_THAT(refusal([&] { throw_write_failure(folder.file("x"), ENOSPC); }), HasSubstr("make room"));
  EXPECT_THAT(refusal([&] { throw_write_failure(folder.file("x"), EROFS); }), HasSubstr("read-only"));
  EXPECT_THAT(refusal([&] { throw_write_failure(folder.file("x"), EACCES); }), HasSubstr("may write to"));
  EXPECT_EQ(names_in(folder.file("")), std::vector<std::string>{"file"});
}

TEST(NewFile, OnlyWhatTheDeadLeftIsRemoved) {
  const TemporaryFolder folder;
  fs::create_directory(folder.file("below"));
  put(folder.file("a.part"), "somebody's own");
  const pid_t child = fork();
  if (child == 0) {
    NewFile file(folder.file("below/a"), Existing::replace);
    file.write("half");
    kill(getpid(), SIGKILL);
  }
  waitpid(child, nullptr, 0);
  EXPECT_EQ(names_in(folder.file("below")).size(), 1u);
  NewFile alive(folder.file("below/b"), Existing::replace);
  remove_leftovers(folder.file(""));
  EXPECT_EQ(names_in(folder.file("below")).size(), 1u);
  alive.put();
  remove_leftovers(folder.file(""));
  EXPECT_EQ(names_in(folder.file("below")), std::vector<std::string>{"b"});
  EXPECT_TRUE(fs::exists(folder.file("a.part")));
}

Recording small() {
  return testing::play(0, {{1e6, 1}, {0, 1}}, 200);
}

void note(const std::string& path, const std::string& text) {
  change_recording(path, [&](Recording& r) { r.events.push_back({0, "note", text}); });
}

TEST(ChangeRecording, NoNoteOfManyIsLostAndNobodyReadsHalfAFile) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.h5");
  const auto before = small();
  write_recording(path, before);
  constexpr int writers = 6, notes = 8;
  std::atomic<int> over = 0, reads = 0;
  std::jthread reader([&] {
    while (over < writers) {
      EXPECT_NO_THROW(EXPECT_EQ(read_recording(path).size(), before.size()));
      ++reads;
    }
  });
  {
    std::vector<std::jthread> all;
    for (int i = 0; i < writers; ++i)
      all.emplace_back([&, i] {
        for (int k = 0; k < notes; ++k) note(path, std::to_string(i) + "." + std::to_string(k));
        ++over;
      });
  }
  reader.join();
  EXPECT_GT(reads, 0);
  EXPECT_EQ(read_recording(path).events.size(), before.events.size() + writers * notes);
  EXPECT_EQ(names_in(folder.file("")), std::vector<std::string>{"a.h5"});
}

// Two programs write notes and are killed; what is there is always whole and never loses what it had.
TEST(ChangeRecording, ProgramsThatAreKilledCostNothing) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.h5");
  write_recording(path, small());
  std::mt19937_64 random(7);
  const auto begin = std::chrono::steady_clock::now();
  note(path, "to see how long one takes here");
  const std::chrono::duration<double, std::micro> one = std::chrono::steady_clock::now() - begin;
  std::uniform_real_distribution<double> lifetime(one.count(), 5 * one.count());
  const auto before = read_recording(path).events.size();
  auto notes = before;
  for (int round = 0; round < 25; ++round) {
    std::array<pid_t, 2> children{};
    for (auto& child : children) {
      child = fork();
      if (child != 0) continue;
      for (;;) note(path, "by a child");
    }
    usleep(static_cast<useconds_t>(lifetime(random)));
    for (const auto child : children) kill(child, SIGKILL);
    for (const auto child : children) waitpid(child, nullptr, 0);
    const auto now = read_recording(path).events.size();
    EXPECT_GE(now, notes);
    notes = now;
  }
  EXPECT_GT(notes, before);
  remove_leftovers(folder.file(""));
  EXPECT_EQ(names_in(folder.file("")), std::vector<std::string>{"a.h5"});
}

TEST(ChangeRecording, ADeletedRecordingDoesNotComeBack) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.h5");
  for (int round = 0; round < 10; ++round) {
    write_recording(path, small());
    std::jthread annotating([&] {
      try {
        for (;;) note(path, "still here");
      } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::not_found) << error.what();
      }
    });
    usleep(5000);
    remove_recording(path);
    annotating.join();
    EXPECT_TRUE(names_in(folder.file("")).empty());
  }
}

TEST(Writer, KeepsTheOldFileUntilTheNewOneIsWhole) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.h5");
  const auto before = small();
  write_recording(path, before);
  const auto bytes = text_of(path);
  EXPECT_THROW(Writer(path, before.header, all_channels), NameTaken);
  EXPECT_EQ(journal_state(path), JournalState::none);
  {
    Writer writer(path, before.header, all_channels, {}, Existing::replace);
    EXPECT_EQ(text_of(path), bytes);
    EXPECT_THROW(Writer(path, before.header, all_channels, {}, Existing::replace), Error);
    writer.discard();
  }
  EXPECT_EQ(text_of(path), bytes);
  { Writer broken(path, before.header, all_channels, {}, Existing::replace); }
  EXPECT_EQ(journal_state(path), JournalState::left);
  EXPECT_EQ(text_of(path), bytes);
  Writer writer(path, before.header, all_channels, {}, Existing::replace);
  writer.finish("complete", "", {}, {});
  EXPECT_EQ(read_recording(path).size(), 0u);
  EXPECT_EQ(names_in(folder.file("")), std::vector<std::string>{"a.h5"});
}

TEST(Writer, ARunThatWasOverLaterKeepsItsJournal) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.h5");
  Writer writer(path, small().header, all_channels);
  write_recording(path, small(), Existing::keep);
  const auto bytes = text_of(path);
  EXPECT_THAT(refusal([&] { writer.finish("complete", "", {}, {}); }), HasSubstr("kept in the journal"));
  EXPECT_EQ(text_of(path), bytes);
  EXPECT_EQ(journal_state(path), JournalState::left);
}

// As a program leaves it that dies between the file and the end of its journal.
TEST(Writer, AFileThatItsRunHasAlreadyIsNoFailure) {
  const TemporaryFolder folder;
  const auto path = folder.file("a.h5");
  const auto r = small();
  Rows rows{.time = r.time, .channels = {}, .counts = {}};
  std::vector<Channel> there;
  for (const auto channel : all_channels)
    if (r.has(channel)) {
      there.push_back(channel);
      rows.channels.at(static_cast<std::size_t>(channel)) = r.at(channel);
    }
  Writer writer(path, r.header, there);
  writer.append(rows);
  write_recording(path, r, Existing::keep);
  const auto bytes = text_of(path);
  writer.finish("complete", "", {}, {});
  EXPECT_EQ(text_of(path), bytes);
  EXPECT_EQ(journal_state(path), JournalState::none);
}

}  // namespace
}  // namespace ferrobench::recordings
