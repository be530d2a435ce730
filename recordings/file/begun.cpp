#include "recordings/file/begun.h"

#include <cerrno>

#include "base/error.h"
#include "recordings/file/pack.h"
#include "recordings/file/reader.h"
#include "recordings/file/recover.h"

namespace ferrobench::recordings {

namespace {

Descriptor begun(const std::string& path, const Begin& begin, Existing existing) {
  if (existing == Existing::replace) remove_journal(path);
  JournalWriter writer(journal_path(path), begin);
  try {  // the journal holds the name from here on
    demand_place(path, existing);
  } catch (const Error&) {
    writer.remove();
    throw;
  }
  return writer.file();
}

// Whoever had this run before made its file, with all of its rows, and died before the journal was gone.
bool is_made(const std::string& path, const Begin& begin, std::uint64_t rows) try {
  const auto& identifier = begin.header.entry_identifier;
  if (identifier.empty() || present_file(path) != path) return false;
  const auto made = read_summary(path);
  return made.header.entry_identifier == identifier && made.rows == rows;
} catch (const Error&) {
  return false;
}

}  // namespace

BegunRecording::BegunRecording(const std::string& path, const Begin& begin, Existing existing)
    : path_(path), existing_(existing), begin_(begin), journal_(begun(path, begin, existing)) {}

BegunRecording::BegunRecording(const std::string& path, Descriptor journal, Existing existing)
    : path_(path), existing_(existing), journal_(std::move(journal)) {
  begin_ = JournalReader(this->journal(), journal_path(path)).begin();
}

Descriptor BegunRecording::journal() const {
  auto out = journal_.duplicate();
  if (!out) throw_write_failure(journal_path(path_), errno);
  return out;
}

void BegunRecording::finish(const Ending& ending, std::uint64_t rows) {
  for (int attempt = 1;; ++attempt) try {
      const JournalReader written(journal(), journal_path(path_));
      if (written.rows() < rows)
        throw Error(
            ErrorCode::io_error, "the journal cannot be read back",
            Problem{.message = "has fewer rows than were written", .given = written.rows(), .allowed = rows});
      auto events = written.events();
      if (const auto loss = loss_of(ending, written.rows(), written.last_time())) events.push_back(*loss);
      pack(written, ending, events, path_, existing_);
      break;
    } catch (const Error& error) {
      if (is_made(path_, begin_, rows)) break;
      // A failure that came once may not come again.
      if (attempt == 1 && error.code() != ErrorCode::disk_full) continue;
      auto problems = error.problems();
      if (is_at(journal_path(path_), journal_))
        problems.push_back({.message = "the samples are kept in the journal",
                            .given = journal_path(path_),
                            .hint = "make room or mend the disk, then: ferrobench recover " + path_});
      throw Error(error.code(), error.message(), std::move(problems));
    }
  try {
    discard();
  } catch (const Error&) {  // a journal beside a whole file is removed by the next recovery
  }
}

void BegunRecording::discard() {
  remove_durably(journal_path(path_), journal_);
}

}  // namespace ferrobench::recordings
