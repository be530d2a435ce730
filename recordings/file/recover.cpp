#include "recordings/file/recover.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <filesystem>

#include "base/error.h"
#include "recordings/file/pack.h"
#include "recordings/file/reader.h"
#include "recordings/format/iso_time.h"
#include "recordings/journal/writer.h"

namespace ferrobench::recordings {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view journal_suffix = ".journal";

std::string recording_of(const std::string& path) {
  return path.ends_with(journal_suffix) ? path.substr(0, path.size() - journal_suffix.size()) : path;
}

bool exists(const std::string& path) {
  std::error_code ignored;
  return fs::exists(path, ignored);
}

void remove_file(const std::string& path) {
  if (unlink(path.c_str()) != 0 && errno != ENOENT)
    throw Error(ErrorCode::io_error, "the file cannot be removed",
                Problem{.message = std::generic_category().message(errno), .given = path});
  sync_folder_of(path);
}

// Whole and of the same run?
void demand_same_run(const std::string& path, const JournalReader& journal) {
  const auto known = [&]() -> std::optional<Summary> {
    try {
      return read_summary(path);
    } catch (const Error&) {
      return std::nullopt;
    }
  }();
  if (known && known->header.entry_identifier == journal.begin().header.entry_identifier &&
      known->rows >= journal.rows())
    return;
  throw Error(ErrorCode::busy, "a file of this name is there already, and it is not what the journal holds",
              Problem{.message = known ? "is of another run" : "cannot be read",
                      .given = path,
                      .hint = "give the file another name, then recover again"});
}

std::string seconds(double value) {
  std::array<char, 32> text{};
  (void)std::snprintf(text.data(), text.size(), "%.3f s", value);
  return text.data();
}

Recovery recover_locked(const JournalReader& journal, const std::string& path,
                        const std::function<void(double)>& progress) {
  using Tail = JournalReader::Tail;
  const auto from = journal_path(path);
  Recovery out{.path = path, .rows = journal.rows(), .bytes_lost = journal.bytes_lost(), .message = {}};
  if (journal.begun() && exists(path)) {
    demand_same_run(path, journal);
    remove_file(from);
    out.outcome = Recovered::already_whole;
    out.message = "the file is whole; its journal was removed";
    return out;
  }
  if (journal.rows() == 0 && journal.tail() != Tail::damaged) {
    remove_file(from);
    out.outcome = Recovered::nothing;
    out.message = "no sample had been recorded; the journal was removed";
    return out;
  }
  auto events = journal.events();
  Ending ending;
  if (journal.ending()) {
    out.outcome = Recovered::completed;
    ending = *journal.ending();
    const auto loss = loss_of(ending, out.rows, journal.last_time());
    events.push_back({journal.last_time(), "recovered",
                      loss ? "the program ended before the file was made"
                           : "the program ended before the file was made; nothing is missing"});
    if (loss) events.push_back(*loss);
    out.message = std::to_string(out.rows) + " samples, " +
                  (loss ? std::to_string(ending.rows_lost) + " missing at the end" : "nothing missing");
  } else {
    out.outcome = Recovered::recovered;
    const auto& header = journal.begin().header;
    ending.end_time = iso_after(header.start_time, journal.last_time()).value_or("");
    ending.status = "recovered";
    ending.reason = "broke off after " + seconds(journal.last_time()) + ": the recording was never closed";
    events.push_back(
        {journal.last_time(), "gap",
         "the recording breaks off here, after " + std::to_string(out.rows) +
             " samples; what was measured after it is missing: no more than the last 0.25 s if the program "
             "was killed, all of the rest if the disk was full or failed"});
    out.message =
        std::to_string(out.rows) + " samples, until it broke off after " + seconds(journal.last_time());
  }
  const bool damaged = journal.tail() == Tail::damaged;
  auto aside = from + ".damaged";  // of a name that an earlier one may have
  for (int number = 2; fs::exists(fs::symlink_status(aside)); ++number)
    aside = from + ".damaged-" + std::to_string(number);
  if (damaged) {
    const auto text =
        std::to_string(out.bytes_lost) + " bytes at the end of the journal were damaged and left out";
    events.push_back({journal.last_time(), "damage", text});
    out.message += "; " + text + " (kept in " + fs::path(aside).filename().string() + ")";
  }
  pack(journal, ending, events, path, Existing::keep, progress);
  if (damaged)
    rename_durably(from, aside);
  else
    remove_file(from);
  return out;
}

}  // namespace

std::string_view recovered_name(Recovered outcome) {
  constexpr std::array<std::string_view, 5> names{"recovered", "completed", "already_whole", "nothing",
                                                  "running"};
  return names.at(static_cast<std::size_t>(outcome));
}

std::vector<std::string> find_broken(const std::string& folder) {
  std::vector<std::string> out;
  std::error_code failure;
  fs::recursive_directory_iterator entry(folder, fs::directory_options::skip_permission_denied, failure), end;
  for (; !failure && entry != end; entry.increment(failure)) {
    std::error_code ignored;
    const auto path = entry->path().string();
    if (path.ends_with(journal_suffix) && entry->is_regular_file(ignored)) out.push_back(recording_of(path));
  }
  if (failure)
    throw Error(ErrorCode::io_error, "the folder cannot be read",
                Problem{.message = failure.message(), .given = folder});
  std::ranges::sort(out);
  return out;
}

Recovery recover_recording(const std::string& given, const std::function<void(double)>& progress) {
  const auto path = recording_of(given);
  auto file = open_file(journal_path(path), O_RDWR | O_NONBLOCK | O_NOFOLLOW);
  if (!file) {
    if (errno != ENOENT) throw_write_failure(journal_path(path), errno);
    if (exists(path))
      return {
          .path = path, .outcome = Recovered::already_whole, .message = "the file is whole, nothing to do"};
    throw Error(ErrorCode::not_found, "there is nothing to recover",
                Problem{.message = "neither the recording nor its journal is there", .given = path});
  }
  struct stat info {};
  if (!try_lock(file))
    return {.path = path, .outcome = Recovered::running, .message = "is being written, left alone"};
  if (fstat(file.get(), &info) == 0 && info.st_nlink == 0) return recover_recording(given, progress);
  return recover_locked(JournalReader(std::move(file), journal_path(path)), path, progress);
}

JournalState journal_state(const std::string& path) {
  const auto file = open_file(journal_path(recording_of(path)), O_RDONLY | O_NONBLOCK);
  if (!file) return JournalState::none;
  return is_locked(file) ? JournalState::being_written : JournalState::left;
}

std::string present_file(const std::string& path) {
  return !exists(path) && exists(journal_path(path)) ? journal_path(path) : path;
}

namespace {

// A journal that nobody writes, locked; empty if there is none.
Descriptor left_journal(const std::string& path) {
  auto journal = open_file(journal_path(path), O_RDWR | O_NONBLOCK | O_NOFOLLOW);
  if (journal && !try_lock(journal))
    throw Error(ErrorCode::busy, "this recording is being written",
                Problem{.given = path, .hint = "wait for the end of its run"});
  return journal;
}

}  // namespace

void remove_journal(const std::string& path) {
  if (left_journal(path)) remove_file(journal_path(path));
}

void remove_recording(const std::string& path) {
  const auto journal = left_journal(path);
  const auto file = open_locked(path);  // a change that goes on would bring it back
  remove_file(path);
  if (journal) remove_file(journal_path(path));
}

}  // namespace ferrobench::recordings
