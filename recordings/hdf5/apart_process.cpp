#include "recordings/hdf5/apart_process.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <limits>
#include <system_error>

#include "recordings/format/texts.h"
#include "recordings/hdf5/apart_child.h"

namespace ferrobench::recordings {

using Clock = std::chrono::steady_clock;

namespace {

// Above those that the child has for other things.
Descriptor moved_up(Descriptor file) {
  return Descriptor(file ? fcntl(file.get(), F_DUPFD_CLOEXEC, STDERR_FILENO + 1) : -1);
}

std::string seconds_text(std::chrono::milliseconds time) {
  return nlohmann::json(std::chrono::duration<double>(time).count()).dump();
}

[[noreturn]] void throw_told(const nlohmann::json& text) {
  std::vector<Problem> problems;
  for (const auto& p : text.at("problems"))
    problems.push_back({.path = p.value("path", ""),
                        .message = p.value("message", ""),
                        .given = p.value("given", nlohmann::json()),
                        .allowed = p.value("allowed", nlohmann::json()),
                        .unit = p.value("unit", ""),
                        .hint = p.value("hint", "")});
  const auto table = error_table();
  const auto found = std::ranges::find(table, text.at("name").get<std::string>(), &ErrorEntry::name);
  throw Error(found == table.end() ? ErrorCode::bad_recording : found->code, text.at("message"),
              std::move(problems));
}

}  // namespace

Error unreadable(const std::string& path, ErrorCode code, const std::string& message,
                 const std::string& hint) {
  return {code, "the file is not a readable recording",
          Problem{.message = message, .given = path, .hint = hint}};
}

ReadingChild::ReadingChild(std::string_view wanted, std::span<const std::string> paths,
                           const ReadLimits& limits)
    : shared_(moved_up(Descriptor(memfd_create("recording", MFD_CLOEXEC)))) {
  std::string asked;
  for (const auto& path : paths) asked.append(path).push_back('\0');
  std::array<int, 2> pipe{-1, -1};
  const bool piped = pipe2(pipe.data(), O_CLOEXEC) == 0;
  told_ = Descriptor(pipe[0]);
  const auto to = moved_up(Descriptor(pipe[1]));
  if (!shared_ || !piped || !to)
    throw unreadable(paths[0], ErrorCode::io_error, std::generic_category().message(errno));
  write_all(shared_, asked, "");

  const std::array arguments{std::string(child_name), std::string(wanted),
                             std::to_string(limits.processor.count()),
                             std::to_string(limits.recording_bytes)};
  try {
    child_.emplace(arguments, shared_.get(), to.get());
  } catch (const std::system_error& failure) {
    throw unreadable(paths[0], ErrorCode::io_error,
                     "no process could be started to read it: " + failure.code().message());
  }
}

void ReadingChild::say_why(const std::string& path, const ReadLimits& limits) {
  const int status = child_->end();
  const auto code = ErrorCode::bad_recording;
  if (children_are_ended())
    throw Ended{unreadable(path, ErrorCode::io_error, "was not read: the program is about to end")};
  if (WIFSIGNALED(status) && WTERMSIG(status) == SIGPROF)
    throw Ended{unreadable(path, code,
                           "took the HDF5 library more than " + seconds_text(limits.processor) +
                               " s of processor time, which is all that a file of this size may take",
                           "it may be damaged, or packed so that it is slow to unpack; h5repack can help")};
  throw Ended{unreadable(path, code, "makes the HDF5 library crash: it is damaged")};
}

std::string ReadingChild::line(const std::string& path, Clock::time_point until, const ReadLimits& limits) {
  for (std::size_t looked_at = 0;;) {
    if (const auto end = text_.find('\n', looked_at); end != std::string::npos) {
      auto out = text_.substr(0, end);
      text_.erase(0, end + 1);
      return out;
    }
    looked_at = text_.size();
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now()).count();
    pollfd wait{.fd = told_.get(), .events = POLLIN, .revents = 0};
    const int ready = left > 0 ? poll(&wait, 1, static_cast<int>(left)) : 0;
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) {
      child_->end();
      throw Ended{unreadable(path, ErrorCode::bad_recording,
                             "took longer to read than the " + seconds_text(limits.clock) +
                                 " s that a file of this size may take",
                             "it may be damaged, or the disk or the machine be very busy: try again")};
    }
    std::array<char, 65536> part;
    const auto got = ::read(told_.get(), part.data(), part.size());
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0 || text_.size() > most_text) say_why(path, limits);
    text_.append(part.data(), static_cast<std::size_t>(got));
  }
}

Frame ReadingChild::next(const std::string& path, const ReadLimits& limits) {
  const auto until = Clock::now() + limits.clock;
  const auto next_line = [&] { return line(path, until, limits); };
  try {
    const auto counts = nlohmann::json::parse(next_line());
    if (counts.contains("error")) throw_told(counts["error"]);
    Frame f;
    f.begin = begin_of(next_line());
    f.ending = ending_of(next_line());
    for (auto left = counts.at("events").get<std::uint64_t>(); left > 0; --left)
      f.events.push_back(event_of(next_line()));
    f.rows = counts.at("rows");
    const auto& duration = counts.at("duration");
    f.duration = duration.is_null() ? std::numeric_limits<double>::quiet_NaN() : duration.get<double>();
    f.segment_count = counts.at("segments");
    f.event_count = counts.at("event_count");
    return f;
  } catch (const nlohmann::json::exception&) {  // not what our reader tells
    say_why(path, limits);
  }
}

}  // namespace ferrobench::recordings
