#include "recordings/journal/reader.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <limits>

#include "base/error.h"
#include "recordings/format/sound.h"
#include "recordings/format/texts.h"
#include "recordings/journal/writer.h"

namespace ferrobench::recordings {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& message, const std::string& hint = "") {
  throw Error(ErrorCode::bad_recording, "this journal cannot be read",
              Problem{.message = message, .given = path, .hint = hint});
}

Descriptor open_journal(const std::string& path) {
  auto file = open_file(path, O_RDONLY | O_NONBLOCK);
  if (!file)
    throw Error(errno == ENOENT ? ErrorCode::not_found : ErrorCode::io_error,
                "the recording cannot be opened",
                Problem{.message = std::generic_category().message(errno), .given = path});
  return file;
}

}  // namespace

JournalReader::JournalReader(const std::string& path) : JournalReader(open_journal(path), path) {}

JournalReader::JournalReader(Descriptor file, std::string path)
    : path_(std::move(path)), file_(std::move(file)) {
  struct stat info {};
  if (fstat(file_.get(), &info) != 0 || !S_ISREG(info.st_mode)) fail(path_, "is not a file");
  size_ = static_cast<std::uint64_t>(info.st_size);
  scan();
}

// As many bytes as there are.
std::string JournalReader::bytes_at(std::uint64_t place, std::uint64_t count) const {
  std::string out(std::min(count, size_ - std::min(size_, place)), '\0');
  const auto got = read_at(file_, place, out.data(), out.size());
  if (got.failure != 0)
    throw Error(ErrorCode::io_error, "the journal could not be read",
                Problem{.message = std::generic_category().message(got.failure), .given = path_});
  out.resize(got.count);
  return out;
}

void JournalReader::scan() {
  for (std::uint64_t sequence = 0; good_ < size_; ++sequence) {
    const auto head_text = bytes_at(good_, head_bytes);
    const auto head = decode_head(head_text);
    const bool ours =
        head && head->sequence == sequence && (head->kind == RecordKind::begin) == (sequence == 0);
    if (!ours) {
      tail_ = head_text.size() < head_bytes ? Tail::torn : Tail::damaged;
      break;
    }
    const auto payload = bytes_at(good_ + head_bytes, head->bytes);
    if (!fits(*head, payload) || !take(*head, good_ + head_bytes, payload)) {
      tail_ = payload.size() < head->bytes ? Tail::torn : Tail::damaged;
      break;
    }
    good_ += head_bytes + head->bytes;
  }
  if (!begun_ && tail_ == Tail::damaged)
    fail(path_, "does not begin as a journal", "nothing can be recovered from it; it stays where it is");
}

// False if the record cannot stand here.
bool JournalReader::take(const RecordHead& head, std::uint64_t place, std::string_view payload) {
  if (ending_) return false;
  switch (head.kind) {
    case RecordKind::begin:
      begin_ = begin_of(payload);
      if (!begin_.others.empty()) fail(path_, "has columns beside the channels, which no run has");
      begun_ = true;
      return true;
    case RecordKind::rows: {
      if (head.rows == 0 || head.bytes != head.rows * begin_.row_bytes()) return false;
      if (rows_ == 0) std::memcpy(&first_time_, payload.data(), sizeof first_time_);
      std::memcpy(&last_time_, payload.data() + 8 * (head.rows - 1), sizeof last_time_);
      places_.push_back({place, head});
      rows_ += head.rows;
      return true;
    }
    case RecordKind::event:
      events_.push_back(event_of(payload));
      return true;
    case RecordKind::end:
      ending_ = ending_of(payload);
      return true;
  }
  return false;
}

void JournalReader::read(std::size_t portion, const std::function<void(const Columns&)>& take) const {
  Columns columns;
  for (const auto& place : places_) {
    const auto payload = bytes_at(place.offset, place.head.bytes);
    if (!fits(place.head, payload)) fail(path_, "changed while it was read", "try again");
    add_rows(begin_, place.head, payload, columns);
    if (columns.time.size() < portion) continue;
    take(columns);
    columns.clear();
  }
  if (!columns.time.empty()) take(columns);
}

bool is_journal(const std::string& path) {
  const auto file = open_file(path, O_RDONLY | O_NONBLOCK);
  char start[4]{};
  return file && pread(file.get(), start, sizeof start, 0) == sizeof start &&
         std::string_view(start, 4) == "FBJR";
}

namespace {

struct State {
  std::string status = "running", reason, end_time;
};

State state_of(const JournalReader& journal) {
  if (const auto& end = journal.ending()) return {end->status, end->reason, end->end_time};
  if (journal.is_being_written()) return {};
  return {.status = "broken_off", .reason = "'ferrobench recover' makes the file whole", .end_time = {}};
}

JournalReader open_begun(const std::string& path) {
  JournalReader journal(path);
  if (!journal.begun())
    fail(path, "was left before anything was recorded", "'ferrobench recover' removes it");
  return journal;
}

}  // namespace

Recording read_journal(const std::string& path) {
  const auto journal = open_begun(path);
  const auto& begin = journal.begin();
  auto [status, reason, end_time] = state_of(journal);
  Recording r;
  r.header = begin.header;
  r.status = std::move(status);
  r.reason = std::move(reason);
  r.end_time = std::move(end_time);
  r.events = journal.events();
  if (const auto& end = journal.ending()) {
    r.segments = within(end->segments, journal.rows());
    r.noise = end->noise;
  }
  Columns all;
  journal.read(std::numeric_limits<std::size_t>::max(), [&](const Columns& columns) { all = columns; });
  r.time = std::move(all.time);
  for (const auto channel : begin.channels)
    r.set(channel) = std::move(all.channels.at(static_cast<std::size_t>(channel)));
  if (!begin.raw.empty()) r.raw = Raw{begin.raw, std::move(all.counts)};
  return r;
}

Summary summarize_journal(const std::string& path) {
  const auto journal = open_begun(path);
  auto [status, reason, end_time] = state_of(journal);
  return {.header = journal.begin().header,
          .path = path,
          .status = std::move(status),
          .reason = std::move(reason),
          .end_time = std::move(end_time),
          .rows = journal.rows(),
          .duration = journal.last_time() - journal.first_time(),
          .channels = journal.begin().channels,
          .segment_count = journal.ending() ? journal.ending()->segments.size() : 0,
          .event_count = journal.events().size()};
}

}  // namespace ferrobench::recordings
