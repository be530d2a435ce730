// The parts that a recording is written and read in.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "base/error.h"
#include "recordings/format/recording.h"

namespace ferrobench::recordings {

// Columns of equal length; an absent channel is empty. counts: rows by raw columns, may be empty.
struct Rows {
  std::span<const double> time;
  std::array<std::span<const double>, 5> channels;
  std::span<const std::int16_t> counts;
  std::vector<std::span<const double>> others{};
};

// What a recording begins with.
struct Begin {
  Header header;
  std::vector<Channel> channels;
  std::vector<RawColumn> raw;
  std::vector<ColumnName> others{};  // a journal has none
  std::size_t row_bytes() const { return 8 * (1 + channels.size() + others.size()) + 2 * raw.size(); }
};
// What is known only at the end of a run.
struct Ending {
  std::string end_time, status, reason;
  std::vector<SegmentRow> segments;
  std::array<std::optional<double>, 5> noise;
  std::uint64_t rows_lost = 0;  // measured after the last one here, and not recorded
};
// The event that says so; none if nothing was lost.
std::optional<Event> loss_of(const Ending& ending, std::uint64_t rows, double last_time);

// Columns of rows that belong to somebody else's memory, and their own.
struct Columns {
  std::vector<double> time;
  std::array<std::vector<double>, 5> channels;
  std::vector<std::int16_t> counts;
  Rows rows() const;
  void clear();
};

// Header, sizes, status, but no samples.
struct Summary {
  Header header;
  std::string path, status, reason, end_time;
  std::uint64_t rows = 0;
  double duration = 0;
  std::vector<Channel> channels;
  std::size_t segment_count = 0, event_count = 0;
};
using SummaryOrError = std::variant<Summary, Error>;

// Is the status "running" or "broken_off", so that the end is missing?
bool is_open(const std::string& status);

}  // namespace ferrobench::recordings
