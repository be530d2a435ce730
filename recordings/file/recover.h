// Makes files whole whose run broke off. What the journal holds becomes the HDF5 file, with status
// "recovered" and an event that states the gap; a run that was closed before its file was made keeps its own
// status. The journal goes when the file is on the disk, or is kept aside (NAME.h5.journal.damaged) if it was
// damaged in more than its last record. Doing it again, or breaking it off at any moment, changes nothing.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace ferrobench::recordings {

enum class Recovered {
  recovered,      // the run broke off; the file has what was recorded until then
  completed,      // the run had been closed, only its file was missing
  already_whole,  // the file was there; a left journal was removed
  nothing,        // no sample had been recorded; the journal was removed
  running,        // somebody is writing it; untouched
};
std::string_view recovered_name(Recovered outcome);  // "recovered", ...

struct Recovery {
  std::string path;  // of the recording
  Recovered outcome{};
  std::uint64_t rows = 0;
  std::uint64_t bytes_lost = 0;  // at the end of the journal, of no use
  std::string message;           // what was done, in a sentence
};

// The recordings (their own paths, whether there yet or not) that a journal lies beside, in the folder and
// those in it.
std::vector<std::string> find_broken(const std::string& folder);
// `given`: path of the recording or of its journal. Error(not_found) if neither is there,
// Error(bad_recording) if nothing can be read from the journal, which then stays, Error(busy) if a file of
// another run has the name, Error(disk_full | io_error).
Recovery recover_recording(const std::string& given, const std::function<void(double)>& progress = nullptr);

// Whether a journal lies beside a recording, and whether somebody is writing it.
enum class JournalState { none, left, being_written };
JournalState journal_state(const std::string& path);
// The file that holds the recording now: itself, or its journal.
std::string present_file(const std::string& path);
// The journal of a run that broke off, if there is one. Error(busy) while it is being written,
// Error(io_error).
void remove_journal(const std::string& path);
// Both of them. Error(busy) while it is being written, Error(io_error).
void remove_recording(const std::string& path);

}  // namespace ferrobench::recordings
