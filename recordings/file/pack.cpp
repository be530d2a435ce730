#include "recordings/file/pack.h"

#include "base/error.h"
#include "recordings/format/sound.h"
#include "recordings/hdf5/input.h"
#include "recordings/hdf5/output_file.h"

namespace ferrobench::recordings {
namespace {

// What was written is looked at once more before it takes the place of anything.
void check(const std::string& path, const Begin& begin, std::uint64_t rows) {
  const hdf5::Input in(path);
  auto places = std::vector<std::string>{"/entry/data/time"};
  for (const auto channel : begin.channels) places.push_back(channel_place(channel));
  for (const auto& column : begin.others) places.push_back(other_place(column.name));
  if (!begin.raw.empty()) places.emplace_back("/entry/instrument/raw/ai");
  for (const auto& place : places)
    if (in.numeric_size(place).rows != rows) in.fail(place, "has not the rows that were written to it");
}

template <class WriteRows>
void make(const std::string& path, Existing existing, const Begin& begin, std::uint64_t rows,
          std::span<const Event> events, const Closing& closing, WriteRows&& write_rows) {
  NewFile out(path, existing);
  OutputFile file(out, begin, rows);
  write_rows(file);
  file.write_events(events);
  file.write_closing(closing);
  file.flush();
  file.close();
  check(out.draft(), begin, rows);
  out.put();
}

}  // namespace

void pack(const JournalReader& journal, const Ending& ending, std::span<const Event> events,
          const std::string& path, Existing existing, const std::function<void(double)>& progress) {
  const auto segments = within(ending.segments, journal.rows());
  make(path, existing, journal.begin(), journal.rows(), events,
       {ending.end_time, ending.status, ending.reason, segments, ending.noise}, [&](OutputFile& file) {
         std::uint64_t done = 0;
         journal.read(OutputFile::chunk_rows, [&](const Columns& columns) {
           file.write(done, columns.rows());
           done += columns.time.size();
           if (progress) progress(static_cast<double>(done) / static_cast<double>(journal.rows()));
         });
       });
}

void pack(const Recording& recording, const std::string& path, Existing existing) {
  Begin begin{recording.header, {}, {}};
  Rows rows{.time = recording.time, .channels = {}, .counts = {}};
  for (const auto channel : all_channels) {
    if (!recording.has(channel)) continue;
    begin.channels.push_back(channel);
    rows.channels.at(static_cast<std::size_t>(channel)) = recording.at(channel);
  }
  if (recording.raw) {
    begin.raw = recording.raw->columns;
    rows.counts = recording.raw->counts;
  }
  for (const auto& column : recording.others) {
    begin.others.push_back(column.as);
    rows.others.emplace_back(column.values);
  }
  make(path, existing, begin, recording.size(), recording.events,
       {recording.end_time, recording.status, recording.reason, recording.segments, recording.noise},
       [&](OutputFile& file) { file.write(0, rows); });
}

}  // namespace ferrobench::recordings
