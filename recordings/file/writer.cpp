#include "recordings/file/writer.h"

#include <algorithm>
#include <cerrno>
#include <utility>

#include "base/error.h"
#include "recordings/file/begun.h"
#include "recordings/file/pack.h"
#include "recordings/file/reader.h"
#include "recordings/format/iso_time.h"
#include "recordings/journal/writer.h"

namespace ferrobench::recordings {

struct Writer::State {
  State(const std::string& path, Existing existing, const Begin& begin)
      : recording(path, begin, existing),
        journal(recording.journal(), journal_path(path), recording.begin()) {}

  BegunRecording recording;
  JournalWriter journal;
  double last_time = 0;
};

Writer::Writer(const std::string& path, const Header& header, std::span<const Channel> channels,
               std::span<const RawColumn> raw, Existing existing)
    : state_(std::make_unique<State>(
          path, existing, Begin{header, {channels.begin(), channels.end()}, {raw.begin(), raw.end()}})) {}

Writer::~Writer() {
  try {
    if (state_) state_->journal.sync();
  } catch (const Error&) {  // nobody is left to tell; the journal keeps what it has
  }
}

void Writer::append(const Rows& rows) {
  auto& s = *state_;
  for (const auto channel : s.journal.begin().channels)
    if (rows.channels.at(static_cast<std::size_t>(channel)).size() != rows.time.size())
      throw std::invalid_argument("Writer::append: columns differ in length");
  if (rows.counts.size() != rows.time.size() * s.journal.begin().raw.size())
    throw std::invalid_argument("Writer::append: counts do not fit the rows");
  if (rows.time.empty()) return;
  s.journal.append(rows);
  s.last_time = rows.time.back();
}

void Writer::add_event(const Event& event) {
  state_->journal.append(event);
}

void Writer::flush() {
  state_->journal.sync();
}

std::uint64_t Writer::rows() const {
  return state_ ? state_->journal.rows() : 0;
}

std::uint64_t Writer::rows_on_disk() const {
  return state_ ? state_->journal.rows_on_disk() : 0;
}

bool Writer::is_in_place() const {
  return !state_ || state_->journal.is_in_place();
}

std::chrono::steady_clock::duration Writer::waiting() const {
  return state_ ? state_->journal.waiting() : std::chrono::steady_clock::duration{};
}

void Writer::discard() {
  std::exchange(state_, nullptr)->recording.discard();
}

void Writer::finish(const std::string& status, const std::string& reason,
                    std::span<const SegmentRow> segments, const std::array<std::optional<double>, 5>& noise,
                    std::uint64_t measured) {
  const auto state = std::move(state_);
  const auto& header = state->journal.begin().header;
  const Ending ending{iso_after(header.start_time, state->last_time).value_or(iso_now()),
                      status,
                      reason,
                      {segments.begin(), segments.end()},
                      noise,
                      std::max(measured, state->journal.rows()) - state->journal.rows()};
  try {
    state->journal.append(ending);
    state->journal.sync();
  } catch (const Error&) {  // a journal that cannot be closed can still be made a file of
  }
  state->recording.finish(ending, state->journal.rows());
}

void write_recording(const std::string& path, const Recording& recording, Existing existing) {
  pack(recording, path, existing);
}

void change_recording(const std::string& path, const std::function<void(Recording&)>& change) {
  const auto held = open_locked(path);
  if (!held && errno != ENOENT) throw_write_failure(path, errno);
  auto recording = read_recording(path);
  change(recording);
  write_recording(path, recording);
}

}  // namespace ferrobench::recordings
