// A recording's HDF5 file on its way to disk: the layout of the format, row by row. Not thread-safe.
// Whatever fails is Error(disk_full) or Error(io_error).
#pragma once

#include <span>
#include <string>
#include <vector>

#include "recordings/file.h"
#include "recordings/hdf5_output.h"

namespace ferrobench::recordings {

// What is known only at the end of a run.
struct Closing {
  std::string end_time, status, reason;
  std::span<const SegmentRow> segments;
  std::array<std::optional<double>, 5> noise;
};

class OutputFile {
 public:
  // growing: a new file (an existing one is refused), unfiltered, rows added as they come. It carries no mark
  // of being open, so what a crash leaves can be read up to the last flush(). packed: replaces what was
  // there; `rows` rows, shuffled and compressed, with checksums on its structure and data.
  enum class Kind { growing, packed };

  OutputFile(const std::string& path, Kind kind, const Header& header, std::span<const Channel> channels,
             std::span<const RawColumn> raw, std::uint64_t rows = 0);

  // Rows from index `first` on. A growing file grows to hold them.
  void write(std::uint64_t first, const Rows& rows);
  // Reads rows back; each span is as long as the number of rows wanted, or empty.
  void read(std::uint64_t first, std::span<double> time, const std::array<std::span<double>, 5>& channels,
            std::span<std::int16_t> counts) const;
  void add_event(const Event& event);                // to a growing file; long messages are cut
  void write_events(std::span<const Event> events);  // into a packed file, all at once
  void write_status(const std::string& status, const std::string& reason = "");
  void write_closing(const Closing& closing);
  void flush() { out_.flush(); }
  void close();

  static constexpr std::uint64_t chunk_rows = 8192;

 private:
  void write_header(const Header& header);
  void make_columns(const Header& header, std::span<const Channel> channels);
  void make_raw(std::span<const RawColumn> raw);
  void make_events();
  hdf5::Handle make_column(const std::string& place, hid_t type, std::size_t width);

  Kind kind_;
  std::uint64_t rows_;
  std::uint64_t events_ = 0;
  std::size_t raw_width_ = 0;
  hdf5::Output out_;
  hdf5::Handle time_;
  std::array<hdf5::Handle, 5> columns_;
  hdf5::Handle counts_;
};

}  // namespace ferrobench::recordings
