#include "tests/faults/kill.h"

#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstring>
#include <random>
#include <thread>

#include "recordings/file/reader.h"
#include "recordings/file/recover.h"
#include "tests/server/engine_bench.h"

namespace ferrobench::faults {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using recordings::Recording;
using recordings::Recovered;

namespace {

// What the child says of its run, again and again.
struct Word {
  std::int64_t rows = 0, on_disk = 0, ended = 0;
  Clock::time_point time{};
};

struct Kind {
  bool fast;
  double ramp, hold, rate;
  Recording whole{};   // of a run that was left alone
  double seconds = 0;  // that it took, from start to file
};

server::RunRequest request(const Kind& kind) {
  auto out = server::request(server::trapezium(kind.ramp, kind.hold), kind.fast);
  out.set = {{"sample_rate_Hz", kind.rate}};
  return out;
}

[[noreturn]] void run_child(const Kind& kind, const fs::path& data, const std::string& path, int told) {
  server::Hub hub;
  // All of it in the process that is killed, its bench too.
  server::Engine engine(data, hub, daq::open_device);
  engine.start(request(kind), path);
  for (;;) {
    const auto status = engine.status();
    const Word word{status.rows, status.rows_on_disk, server::is_over(status.state), Clock::now()};
    if (write(told, &word, sizeof word) != sizeof word || word.ended) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  engine.stop();
  _exit(0);
}

struct Death {
  std::vector<Word> words;
  Clock::time_point time;
};

Death run_and_kill(const Kind& kind, const fs::path& data, const std::string& path, double after) {
  std::array<int, 2> ends{};
  if (pipe(ends.data()) != 0) throw std::runtime_error("no pipe");
  const auto child = fork();
  if (child < 0) throw std::runtime_error("no child");
  if (child == 0) {
    close(ends[0]);
    run_child(kind, data, path, ends[1]);
  }
  close(ends[1]);
  // The pipe is emptied all the time, so the child never waits for it.
  Death death;
  std::thread listener([&] {
    for (Word word; read(ends[0], &word, sizeof word) == sizeof word;) death.words.push_back(word);
  });
  std::this_thread::sleep_for(std::chrono::duration<double>(after));
  death.time = Clock::now();
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  listener.join();
  close(ends[0]);
  return death;
}

// "" or how the first rows of the whole recording differ from those of the part.
std::string difference(const Recording& part, const Recording& whole) {
  if (part.size() > whole.size()) return "has more samples than were measured";
  const auto same = [&](const auto& a, const auto& b, std::size_t count) {
    return std::memcmp(a.data(), b.data(), count * sizeof a[0]) == 0;
  };
  if (!same(part.time, whole.time, part.size())) return "differs in time";
  for (const auto channel : recordings::all_channels) {
    if (part.has(channel) != whole.has(channel)) return "lacks a channel";
    if (part.has(channel) && !same(part.at(channel), whole.at(channel), part.size()))
      return "differs in " + std::string(channel_name(channel));
  }
  if (!part.raw || !same(part.raw->counts, whole.raw->counts, part.raw->counts.size()))
    return "differs in raw counts";
  return "";
}

// How long before its death the device measured the first sample that is missing.
double loss(const Death& death, const Kind& kind, std::uint64_t recovered) {
  auto begin = Clock::time_point::max();
  for (const auto& word : death.words)
    if (word.rows > 0)
      begin = std::min(
          begin, word.time - std::chrono::duration_cast<Clock::duration>(
                                 std::chrono::duration<double>(static_cast<double>(word.rows) / kind.rate)));
  if (begin == Clock::time_point::max()) return 0;
  const double measured = std::chrono::duration<double>(death.time - begin).count();
  const double program = static_cast<double>(kind.whole.size()) / kind.rate;
  return std::min(measured, program) - static_cast<double>(recovered) / kind.rate;
}

// Everything that must hold of one death; what does not is a failure.
void judge(const Death& death, const Kind& kind, const std::string& path, const std::string& name,
           KillFigures& out) {
  const auto fail = [&](const std::string& what) { out.failures.push_back(name + ": " + what); };
  std::int64_t acknowledged = 0;
  for (const auto& word : death.words) acknowledged = std::max(acknowledged, word.on_disk);
  const bool ended = !death.words.empty() && death.words.back().ended != 0;
  out.rows_acknowledged += static_cast<std::uint64_t>(acknowledged);
  try {
    const bool left = recordings::journal_state(path) == recordings::JournalState::left;
    if (!left && !fs::exists(path)) {
      if (acknowledged > 0) fail("acknowledged samples, but there is no file");
      ++out.before_any_file;
      return;
    }
    if (left) {
      const auto done = recordings::recover_recording(path);
      ++out.outcomes.at(static_cast<std::size_t>(done.outcome));
      if (done.outcome == Recovered::nothing) {
        if (acknowledged > 0) fail("acknowledged samples, but none was recovered");
        return;
      }
    } else {
      ++out.after_the_end;
    }
    const auto r = recordings::read_recording(path);
    out.rows_recovered += r.size();
    if (r.size() < static_cast<std::size_t>(acknowledged))
      fail(std::to_string(acknowledged) + " samples acknowledged, " + std::to_string(r.size()) +
           " recovered");
    if (const auto text = difference(r, kind.whole); !text.empty()) fail(text);
    const bool whole = r.size() == kind.whole.size() && r.status == "complete";
    if (!whole && r.status != "recovered") fail("its status is " + r.status);
    if (ended && !whole) fail("the run had ended, but its recording is not complete");
    if (r.status == "recovered" &&
        std::ranges::none_of(r.events, [](const auto& event) { return event.kind == "gap"; }))
      fail("the gap is not stated");
    if (!whole && !kind.fast) out.greatest_loss = std::max(out.greatest_loss, loss(death, kind, r.size()));
    if (recordings::journal_state(path) != recordings::JournalState::none) fail("the journal is still there");
    if (recordings::recover_recording(path).outcome != Recovered::already_whole)
      fail("recovering again did something");
  } catch (const std::exception& error) {
    fail(error.what());
  }
}

}  // namespace

KillFigures kill_runs(int kills, std::uint64_t seed, const fs::path& folder) {
  fs::remove_all(folder);
  fs::create_directories(folder);
  const auto data = folder / "data";
  std::array<Kind, 2> kinds{{{.fast = false, .ramp = 0.3, .hold = 0.4, .rate = 2000},
                             {.fast = true, .ramp = 1, .hold = 1, .rate = 20000}}};
  for (auto& kind : kinds) {
    const auto path = (data / "whole.h5").string();
    const auto begin = Clock::now();
    {
      server::Hub hub;
      server::Engine engine(data, hub);
      engine.wait(engine.start(request(kind), path).run);
    }
    kind.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
    kind.whole = recordings::read_recording(path);
    fs::remove(path);
  }
  KillFigures out;
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> share(0, 1.1);
  for (; out.kills < kills; ++out.kills) {
    const auto& kind = kinds.at(static_cast<std::size_t>(out.kills % 2));
    const auto name = "kill-" + std::to_string(out.kills);
    const auto path = (folder / (name + ".h5")).string();
    judge(run_and_kill(kind, data, path, share(random) * kind.seconds), kind, path, name, out);
  }
  return out;
}

int open_with_h5py(const fs::path& folder, std::vector<std::string>& failures) {
  const auto command =
      std::string(FERROBENCH_PYTHON) + " " + FERROBENCH_OPEN_ALL + " " + folder.string() + " 2>&1";
  std::FILE* answer = popen(command.c_str(), "r");
  if (answer == nullptr) return -1;
  std::string text;
  std::array<char, 4096> part{};
  while (const auto length = std::fread(part.data(), 1, part.size(), answer))
    text.append(part.data(), length);
  const int code = WEXITSTATUS(pclose(answer));
  if (code == 77) return -1;
  if (code != 0) failures.push_back("h5py: " + text);
  return std::atoi(text.c_str());
}

std::ostream& operator<<(std::ostream& out, const KillFigures& f) {
  out << f.kills << " kills: " << f.before_any_file << " before there was a file, " << f.after_the_end
      << " after the file was whole";
  for (std::size_t i = 0; i < f.outcomes.size(); ++i)
    if (f.outcomes.at(i) > 0)
      out << ", " << f.outcomes.at(i) << ' ' << recovered_name(static_cast<Recovered>(i));
  out << ".\n"
      << f.rows_acknowledged << " samples acknowledged, " << f.rows_recovered << " recovered; at most "
      << static_cast<int>(1e3 * f.greatest_loss) << " ms of measuring lost.\n"
      << f.failures.size() << " failures.\n";
  for (const auto& failure : f.failures) out << "  " << failure << '\n';
  return out;
}

}  // namespace ferrobench::faults
