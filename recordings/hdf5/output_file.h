// A recording's HDF5 file on its way to disk: the layout of the format. Not thread-safe.
// Whatever fails is Error(disk_full) or Error(io_error).
#pragma once

#include <span>
#include <string>
#include <vector>

#include "recordings/format/parts.h"
#include "recordings/hdf5/output.h"
#include "recordings/hdf5/target.h"

namespace ferrobench::recordings {

// What is known only at the end of a run.
struct Closing {
  std::string end_time, status, reason;
  std::span<const SegmentRow> segments;
  std::array<std::optional<double>, 5> noise;
};

class OutputFile {
 public:
  // `rows` rows, shuffled and compressed, with checksums on its structure and data.
  OutputFile(const NewFile& file, const Begin& begin, std::uint64_t rows);

  void write(std::uint64_t first, const Rows& rows);  // from index `first` on
  void write_events(std::span<const Event> events);
  void write_closing(const Closing& closing);
  void flush() { out_.flush(); }
  void close();

  static constexpr std::uint64_t chunk_rows = 32768;

 private:
  void write_header(const Header& header);
  void write_past(const protocols::Past& past);
  void make_columns(const Header& header, std::span<const Channel> channels);
  void make_others(std::span<const ColumnName> others);
  void make_raw(std::span<const RawColumn> raw);
  hdf5::Handle make_column(const std::string& place, hid_t type, std::size_t width);

  std::uint64_t rows_;
  std::size_t raw_width_ = 0;
  hdf5::Target target_;
  hdf5::Output out_;
  hdf5::Handle time_;
  std::array<hdf5::Handle, 5> columns_;
  hdf5::Handle counts_;
  std::vector<std::pair<std::string, hdf5::Handle>> others_;  // with their places
};

}  // namespace ferrobench::recordings
