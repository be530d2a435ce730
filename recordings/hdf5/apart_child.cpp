#include "recordings/hdf5/apart_child.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <unistd.h>

#include <new>

#include "base/error.h"
#include "recordings/disk/durable_file.h"
#include "recordings/format/texts.h"
#include "recordings/hdf5/input_file.h"
#include "recordings/process/child.h"

namespace ferrobench::recordings {
namespace {

constexpr int shared_file = STDIN_FILENO, answers = STDOUT_FILENO;
constexpr rlim_t most_own_memory = 1'500'000'000;  // the shared columns are none of it
constexpr rlim_t most_files = 64;                  // a recording is one; HDF5 may be led to others
constexpr rlim_t most_asked = 1 << 24;             // paths of files, which come where the columns go

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool sanitized = true;  // takes terabytes of address space for itself
#elif defined(__has_feature)
constexpr bool sanitized = __has_feature(address_sanitizer) || __has_feature(thread_sanitizer);
#else
constexpr bool sanitized = false;
#endif

// The end of it is a signal of its own.
void allow_processor(long milliseconds) {
  const timeval time{milliseconds / 1000, milliseconds % 1000 * 1000};
  const itimerval timer{{0, 0}, time};
  setitimer(ITIMER_PROF, &timer, nullptr);
}

std::string asked() {
  struct stat info {};
  fstat(shared_file, &info);
  std::string text(static_cast<std::size_t>(info.st_size), '\0');
  if (pread(shared_file, text.data(), text.size(), 0) != info.st_size) _exit(EXIT_FAILURE);
  return text;
}

char* memory_for(std::uint64_t bytes) {
  if (ftruncate(shared_file, 0) != 0 || ftruncate(shared_file, static_cast<off_t>(bytes)) != 0)
    throw std::bad_alloc();
  if (bytes == 0) return nullptr;
  auto* memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, shared_file, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc();
  return static_cast<char*>(memory);
}

std::string json_line(const nlohmann::json& value) {
  return value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + '\n';
}

std::string line_of(const Error& error) {
  auto text = error.data();
  text["message"] = error.message();
  return json_line({{"error", text}});
}

std::string lines_of(const Frame& f) {
  auto out = json_line({{"rows", f.rows},
                        {"duration", f.duration},
                        {"segments", f.segment_count},
                        {"event_count", f.event_count},
                        {"events", f.events.size()}});
  out += begin_text(f.begin) + '\n' + ending_text(f.ending) + '\n';
  for (const auto& event : f.events) out += event_text(event) + '\n';
  return out;
}

std::string answer_for(const std::string& path, bool whole, double most_bytes) {
  try {
    return lines_of(whole ? read_hdf5(path, most_bytes, memory_for) : summarize_hdf5(path));
  } catch (const Error& error) {
    return line_of(error);
  } catch (const std::bad_alloc&) {
    const Error error(
        ErrorCode::bad_recording, "the file is not a readable recording",
        Problem{.message = "takes more memory to read than is allowed",
                .given = path,
                .hint = "it is damaged, or stored in very large chunks: h5repack makes them smaller"});
    return line_of(error);
  }
}

}  // namespace

void serve_as_child(std::string_view wanted, long milliseconds, double most_bytes) {
  be_a_child();
  allow(RLIMIT_NOFILE, most_files);
  allow(RLIMIT_FSIZE, static_cast<rlim_t>(most_bytes) + most_asked);
  if (!sanitized) allow(RLIMIT_DATA, most_own_memory);
  const Descriptor out(answers);
  const auto paths = asked();
  try {
    for (std::size_t at = 0, end = 0; (end = paths.find('\0', at)) != std::string::npos; at = end + 1) {
      allow_processor(milliseconds);
      write_all(out, answer_for(paths.substr(at, end - at), wanted == whole_recordings, most_bytes), "");
    }
    _exit(EXIT_SUCCESS);
  } catch (...) {
    _exit(EXIT_FAILURE);
  }
}

}  // namespace ferrobench::recordings
