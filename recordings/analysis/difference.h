// Two recordings side by side: where their samples differ and by how much, and what else they say
// differently.
//
// For each column, over the rows that both have and know (NaN marks a gap):
//   rms = sqrt(mean((b - a)^2)),  mean = mean(b - a),  maximum = max |b - a|   [unit of the column]
// Two values are equal if their bits are; two gaps are equal.
//
// Rows of one number belong together if their times are less than half a pause between rows apart. Where some
// do not, as of two sampling rates, rms, mean and maximum of the channels are taken at the times of the
// recording with fewer rows, where the other, interpolated between its rows, has such a time; times and raw
// counts have none, NaN.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "recordings/format/recording.h"

namespace ferrobench::recordings {

struct FirstDifference {
  std::uint64_t row = 0;
  std::optional<double> a, b;  // none: the column has no such row
};

struct ColumnDifference {
  std::string dataset;  // its place in the file
  std::string unit;
  bool in_a = false, in_b = false;
  std::uint64_t rows_a = 0, rows_b = 0, unequal = 0;
  double rms = 0, mean = 0, maximum = 0;
  std::optional<FirstDifference> first{};

  double spread() const { return std::sqrt(std::max(0.0, rms * rms - mean * mean)); }  // rms about the mean
  bool identical() const { return in_a && in_b && !first; }
};

// One value that is not the same. `place` is where it stands, null: it is not there.
struct ValueDifference {
  std::string place;
  nlohmann::json a, b;
};

struct Difference {
  std::vector<ColumnDifference> columns;  // every one that either has: time, channels, raw counts
  std::vector<ValueDifference> tables;    // status, noise, segments, events
  std::vector<ValueDifference> header;    // title, specimen, load, protocol, model, device, times, identifier

  bool by_time = false;      // rms, mean and maximum are at common times, not row by row
  std::uint64_t common = 0;  // that many of them

  bool same_samples() const;
  const ColumnDifference* first_column() const;  // the first that differs, or null
};

Difference compare(const Recording& a, const Recording& b);

// What to know of figures at common times, a sentence; "" where they are row by row.
std::string by_time_in_words(const Difference& difference);

nlohmann::json to_json(const Difference& difference);

}  // namespace ferrobench::recordings
