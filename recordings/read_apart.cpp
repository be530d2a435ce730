#include "recordings/read_apart.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <limits>

#include "protocols/common/error.h"

namespace ferrobench::recordings {

using nlohmann::json;

namespace {

constexpr std::string_view child_name = "ferrobench: reads a file apart";
constexpr int handed_over = 3;  // the child's descriptor of the journal
constexpr std::size_t portion = 32768;
constexpr std::string_view all = "all", summary = "summary";  // what it is asked for
enum Outcome { whole = 0, refused = 10 };                     // a sanitizer ends a program with 1

void hand_over(const Recording& r, const Descriptor& to) {
  std::uint64_t sequence = 0;
  const auto put = [&](RecordKind kind, std::size_t rows, std::string_view payload) {
    write_all(to, encode(kind, sequence++, static_cast<std::uint32_t>(rows), payload), "");
  };
  Begin begin{.header = r.header, .channels = {}, .raw = r.raw ? r.raw->columns : std::vector<RawColumn>{}};
  Rows rows{.time = r.time, .channels = {}, .counts = {}};
  for (const auto channel : all_channels) {
    if (!r.has(channel)) continue;
    begin.channels.push_back(channel);
    rows.channels.at(static_cast<std::size_t>(channel)) = r.at(channel);
  }
  if (r.raw) rows.counts = r.raw->counts;
  put(RecordKind::begin, 0, begin_text(begin));
  for (std::size_t first = 0; first < r.size(); first += portion) {
    const auto count = std::min(portion, r.size() - first);
    put(RecordKind::rows, count, rows_payload(begin, rows, first, count));
  }
  for (const auto& event : r.events) put(RecordKind::event, 0, event_text(event));
  put(RecordKind::end, 0, ending_text({r.end_time, r.status, r.reason, r.segments, r.noise}));
}

// Two lines of JSON: what a journal begins with, and the rest.
void hand_over(const Summary& s, const Descriptor& to) {
  const json rest{{"status", s.status},     {"reason", s.reason},     {"end_time", s.end_time},
                  {"rows", s.rows},         {"duration", s.duration}, {"segments", s.segment_count},
                  {"events", s.event_count}};
  write_all(to,
            begin_text({.header = s.header, .channels = s.channels, .raw = {}}) + "\n" +
                rest.dump(-1, ' ', false, json::error_handler_t::replace),
            "");
}

void bound_resources(const std::string& path) {
  close_range(handed_over + 1, ~0U, 0);
  struct stat info {};
  stat(path.c_str(), &info);
  const auto seconds = static_cast<rlim_t>(60 + info.st_size / 1'000'000);
  const rlimit none{0, 0}, time{seconds, seconds};
  setrlimit(RLIMIT_CORE, &none);
  setrlimit(RLIMIT_CPU, &time);
}

// Before main(), so that it works in whatever program this library is part of.
[[gnu::constructor]] void read_if_asked(int argc, char** argv) {
  if (argc != 3 || argv[0] != child_name) return;
  const Descriptor to(handed_over);
  try {
    bound_resources(argv[1]);
    if (argv[2] == summary)
      hand_over(summarize_hdf5(argv[1]), to);
    else
      hand_over(read_hdf5(argv[1]), to);
    _exit(whole);
  } catch (const Error& error) {
    auto text = error.data();
    text["message"] = error.message();
    if (ftruncate(to.get(), 0) == 0 && lseek(to.get(), 0, SEEK_SET) == 0)
      write_all(to, text.dump(-1, ' ', false, json::error_handler_t::replace), "");
    _exit(refused);
  } catch (...) {
    _exit(EXIT_FAILURE);
  }
}

[[noreturn]] void fail_apart(const std::string& path, ErrorCode code, const std::string& message) {
  throw Error(code, "the file is not a readable recording", Problem{.message = message, .given = path});
}

std::string text_in(const Descriptor& from) {
  const auto bytes = std::max<off_t>(0, lseek(from.get(), 0, SEEK_END));
  std::string text(std::min(most_payload, static_cast<std::uint64_t>(bytes)), '\0');
  const auto count = pread(from.get(), text.data(), text.size(), 0);
  text.resize(static_cast<std::size_t>(std::max<ssize_t>(0, count)));
  return text;
}

[[noreturn]] void throw_told(const Descriptor& from, const std::string& path) {
  const auto told = json::parse(text_in(from), nullptr, false);
  if (told.is_discarded()) fail_apart(path, ErrorCode::bad_recording, "is damaged");
  std::vector<Problem> problems;
  for (const auto& p : told.at("problems"))
    problems.push_back({.path = p.value("path", ""),
                        .message = p.value("message", ""),
                        .given = p.value("given", json()),
                        .allowed = p.value("allowed", json()),
                        .unit = p.value("unit", ""),
                        .hint = p.value("hint", "")});
  const auto found = std::ranges::find(error_table(), told.at("name").get<std::string>(), &ErrorEntry::name);
  throw Error(found->code, told.at("message"), std::move(problems));
}

// What the child hands over; Error as it told, or as it ended.
Descriptor told_by_child(const std::string& path, std::string_view what) {
  Descriptor told(memfd_create("recording", MFD_CLOEXEC));
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, told.get(), handed_over);
  std::string name(child_name), given(path), wanted(what);
  const std::array<char*, 4> arguments{name.data(), given.data(), wanted.data(), nullptr};
  pid_t child = 0;
  const int failed =
      told ? posix_spawn(&child, "/proc/self/exe", &actions, nullptr, arguments.data(), environ) : errno;
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) fail_apart(path, ErrorCode::io_error, "no process could be started to read it");
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFEXITED(status) && WEXITSTATUS(status) == whole) return told;
  if (WIFEXITED(status) && WEXITSTATUS(status) == refused) throw_told(told, path);
  fail_apart(path, ErrorCode::bad_recording,
             WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU
                 ? "takes the HDF5 library too long: it is damaged"
                 : "makes the HDF5 library crash: it is damaged");
}

}  // namespace

// Signature, then the version of the superblock; from 2 on, all parts have checksums.
bool has_checksums(const std::string& path) {
  constexpr std::string_view signature("\x89HDF\r\n\x1a\n", 8);
  const auto file = open_file(path, O_RDONLY | O_NONBLOCK);
  std::array<char, signature.size() + 1> start{};
  return file && pread(file.get(), start.data(), start.size(), 0) == static_cast<ssize_t>(start.size()) &&
         std::string_view(start.data(), signature.size()) == signature && start.back() >= 2;
}

JournalReader read_apart(const std::string& path) {
  return {told_by_child(path, all), path};
}

Summary summarize_apart(const std::string& path) {
  const auto text = text_in(told_by_child(path, summary));
  const auto end = std::min(text.find('\n'), text.size());
  auto begin = begin_of(text.substr(0, end));
  try {
    const auto rest = json::parse(text.substr(end));
    const auto& duration = rest.at("duration");
    return {
        .header = std::move(begin.header),
        .path = path,
        .status = rest.at("status"),
        .reason = rest.at("reason"),
        .end_time = rest.at("end_time"),
        .rows = rest.at("rows"),
        .duration = duration.is_null() ? std::numeric_limits<double>::quiet_NaN() : duration.get<double>(),
        .channels = std::move(begin.channels),
        .segment_count = rest.at("segments"),
        .event_count = rest.at("events")};
  } catch (const json::exception&) {
    fail_apart(path, ErrorCode::bad_recording, "is damaged");
  }
}

}  // namespace ferrobench::recordings
