#include "recordings/journal/writer.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

#include "base/error.h"
#include "recordings/disk/new_file.h"
#include "recordings/format/texts.h"

namespace ferrobench::recordings {
namespace {

constexpr std::chrono::milliseconds sync_interval{50};
constexpr std::size_t most_rows = 8192;  // in a record

Descriptor create_journal(const std::string& path) {
  auto file = create_locked(path, LockFailure::fail, O_APPEND);
  if (!file && errno == EEXIST) throw NameTaken(path);
  if (!file) throw_write_failure(path, errno);
  return file;
}

}  // namespace

std::string journal_path(const std::string& recording) {
  return recording + ".journal";
}

JournalWriter::JournalWriter(const std::string& path, Begin begin)
    : path_(path), begin_(std::move(begin)), file_(create_journal(path)) {
  try {
    add(RecordKind::begin, 0, begin_text(begin_));
    if (const int error = sync_data(file_)) throw_write_failure(path_, error);
    sync_folder_of(path_);
  } catch (const Error&) {
    unlink(path_.c_str());
    throw;
  }
  synced_ = written_;
  begin_syncing();
}

JournalWriter::JournalWriter(Descriptor begun, const std::string& path, Begin layout)
    : path_(path), begin_(std::move(layout)), file_(std::move(begun)), sequence_(1) {
  struct stat info {};
  if (fstat(file_.get(), &info) != 0) throw_write_failure(path_, errno);
  written_ = synced_ = static_cast<std::uint64_t>(info.st_size);
  begin_syncing();
}

void JournalWriter::begin_syncing() {
  payload_.reserve(most_rows * begin_.row_bytes());
  record_.reserve(head_bytes + most_rows * begin_.row_bytes());
  syncer_ = std::thread([this] { keep_synced(); });
}

JournalWriter::~JournalWriter() {
  {
    const std::scoped_lock lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  syncer_.join();
}

void JournalWriter::throw_if_failed() const {
  const std::scoped_lock lock(mutex_);
  if (failure_ != 0) throw_write_failure(path_, failure_);
}

void JournalWriter::add(RecordKind kind, std::uint32_t rows, std::string_view payload) {
  if (torn_) throw_write_failure(path_, EIO);
  record_ = encode(kind, sequence_, rows, payload, std::move(record_));
  try {
    write_all(file_, record_, path_);
  } catch (const Error&) {
    torn_ = ftruncate(file_.get(), static_cast<off_t>(written_)) != 0;
    throw;
  }
  ++sequence_;
  rows_ += rows;
  {
    const std::scoped_lock lock(mutex_);
    if (synced_ == written_) oldest_ = std::chrono::steady_clock::now();
    written_ += record_.size();
    rows_written_ = rows_;
  }
  changed_.notify_all();
}

void JournalWriter::append(const Rows& rows) {
  throw_if_failed();
  for (std::size_t done = 0; done < rows.time.size();) {
    const auto count = std::min(most_rows, rows.time.size() - done);
    payload_ = rows_payload(begin_, rows, done, count, std::move(payload_));
    add(RecordKind::rows, static_cast<std::uint32_t>(count), payload_);
    done += count;
  }
}

void JournalWriter::append(const Event& event) {
  throw_if_failed();
  add(RecordKind::event, 0, event_text(event));
}

void JournalWriter::append(const Ending& ending) {
  add(RecordKind::end, 0, ending_text(ending));
}

// A sync that failed is not tried again: the system may have dropped what it could not write.
void JournalWriter::keep_synced() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [&] { return stop_ || synced_ < written_; });
    if (stop_) return;
    const auto bytes = written_, rows = rows_written_;
    const auto begin = std::chrono::steady_clock::now();
    lock.unlock();
    const int error = sync_data(file_);
    const bool in_place = is_at(path_, file_);
    lock.lock();
    failure_ = error;
    in_place_ = in_place_ && in_place;
    if (error == 0) {
      synced_ = bytes;
      rows_synced_ = rows;
      oldest_ = begin;
    }
    changed_.notify_all();
    if (error != 0) return;
    changed_.wait_for(lock, sync_interval, [&] { return stop_ || hurry_; });
  }
}

void JournalWriter::sync() {
  std::unique_lock lock(mutex_);
  hurry_ = true;
  changed_.notify_all();
  changed_.wait(lock, [&] { return failure_ != 0 || synced_ == written_; });
  hurry_ = false;
  if (failure_ != 0) throw_write_failure(path_, failure_);
}

void JournalWriter::remove() {
  remove_durably(path_, file_);
}

std::uint64_t JournalWriter::rows_on_disk() const {
  const std::scoped_lock lock(mutex_);
  return in_place_ ? rows_synced_ : 0;
}

bool JournalWriter::is_in_place() const {
  const std::scoped_lock lock(mutex_);
  return in_place_;
}

Descriptor JournalWriter::file() const {
  auto out = file_.duplicate();
  if (!out) throw_write_failure(path_, errno);
  return out;
}

std::chrono::steady_clock::duration JournalWriter::waiting() const {
  const std::scoped_lock lock(mutex_);
  return synced_ == written_ ? std::chrono::steady_clock::duration{}
                             : std::chrono::steady_clock::now() - oldest_;
}

}  // namespace ferrobench::recordings
