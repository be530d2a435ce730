#include "recordings/hdf5/read_apart.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>

#include "recordings/hdf5/apart_child.h"
#include "recordings/hdf5/apart_process.h"

namespace ferrobench::recordings {
namespace {

std::atomic<double> share = 0.5;

// Before main(), so that it works in whatever program this library is part of.
[[gnu::constructor]] void read_if_asked(int argc, char** argv) {
  if (argc == 4 && argv[0] == child_name)
    serve_as_child(argv[1], std::strtol(argv[2], nullptr, 10), std::strtod(argv[3], nullptr));
}

// Columns out of the shared memory, which each of them leaves as it is taken.
class SharedColumns {
 public:
  SharedColumns(const Descriptor& from, const std::string& path) : from_(from), path_(path) {}

  template <class Value>
  void take(std::vector<Value>& out, std::uint64_t count) {
    out.resize(count);
    auto* to = reinterpret_cast<char*>(out.data());
    const auto end = at_ + static_cast<off_t>(count * sizeof(Value));
    while (at_ < end) {
      constexpr off_t portion = 1 << 26;
      const auto got = pread(from_.get(), to, static_cast<std::size_t>(std::min(portion, end - at_)), at_);
      if (got <= 0)
        throw unreadable(path_, ErrorCode::bad_recording, "makes the HDF5 library crash: it is damaged");
      fallocate(from_.get(), FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, at_, got);
      at_ += got;
      to += got;
    }
  }

 private:
  const Descriptor& from_;
  const std::string& path_;
  off_t at_ = 0;
};

}  // namespace

ReadLimits limits_for(const std::string& path) {
  struct stat info {};
  stat(path.c_str(), &info);
  const std::chrono::seconds seconds(10 + info.st_size / 10'000'000);
  return {.processor = seconds, .clock = 3 * seconds, .recording_bytes = memory_for_each_recording()};
}

void allow_each_recording(double share_of_memory) {
  share = share_of_memory;
}

double memory_for_each_recording() {
  return share * static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGESIZE));
}

Recording read_apart(const std::string& path) {
  return read_apart(path, limits_for(path));
}

Recording read_apart(const std::string& path, const ReadLimits& limits) {
  ReadingChild child(whole_recordings, std::span(&path, 1), limits);
  auto f = [&] {
    try {
      return child.next(path, limits);
    } catch (const Ended& ended) {
      throw Error(ended.error);
    }
  }();
  Recording r;
  r.header = std::move(f.begin.header);
  r.end_time = std::move(f.ending.end_time);
  r.status = std::move(f.ending.status);
  r.reason = std::move(f.ending.reason);
  r.segments = std::move(f.ending.segments);
  r.noise = f.ending.noise;
  r.events = std::move(f.events);
  struct stat info {};
  if (fstat(child.columns().get(), &info) != 0 ||
      static_cast<double>(info.st_size) !=
          static_cast<double>(f.rows) * static_cast<double>(f.begin.row_bytes()))
    throw unreadable(path, ErrorCode::bad_recording, "makes the HDF5 library crash: it is damaged");
  SharedColumns columns(child.columns(), path);
  columns.take(r.time, f.rows);
  for (const auto channel : f.begin.channels) columns.take(r.set(channel), f.rows);
  for (auto& other : f.begin.others)
    columns.take(r.others.emplace_back(OtherColumn{std::move(other), {}}).values, f.rows);
  if (!f.begin.raw.empty()) {
    const auto width = f.begin.raw.size();
    columns.take(r.raw.emplace(Raw{std::move(f.begin.raw), {}}).counts, f.rows * width);
  }
  return r;
}

std::vector<SummaryOrError> summarize_apart(std::span<const std::string> paths) {
  std::vector<ReadLimits> limits;
  for (const auto& path : paths) limits.push_back(limits_for(path));
  std::vector<SummaryOrError> out;
  while (out.size() < paths.size()) {
    const auto first = out.size();
    const auto most = std::ranges::max(std::span(limits).subspan(first), {}, &ReadLimits::processor);
    ReadingChild child(summaries, paths.subspan(first), most);
    while (out.size() < paths.size()) {
      const auto& path = paths[out.size()];
      try {
        auto f = child.next(path, limits[out.size()]);
        out.emplace_back(Summary{.header = std::move(f.begin.header),
                                 .path = path,
                                 .status = std::move(f.ending.status),
                                 .reason = std::move(f.ending.reason),
                                 .end_time = std::move(f.ending.end_time),
                                 .rows = f.rows,
                                 .duration = f.duration,
                                 .channels = std::move(f.begin.channels),
                                 .segment_count = f.segment_count,
                                 .event_count = f.event_count});
      } catch (const Ended& ended) {  // what it had read before may be the cause: the file is read by itself
        if (out.size() == first) out.emplace_back(ended.error);
        break;
      } catch (const Error& told) {
        out.emplace_back(told);
      }
    }
  }
  return out;
}

}  // namespace ferrobench::recordings
