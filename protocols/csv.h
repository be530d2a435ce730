// Time and level pairs from CSV text.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"

namespace ferrobench::protocols {

// Of levels, and per second of rates.
enum class Unit { kv_per_mm, volt };
std::span<const std::pair<Unit, std::string_view>> enum_names(Unit);

struct PointTable {
  std::vector<std::vector<double>> points;  // [s, level in `unit`]
  Unit unit = Unit::kv_per_mm;
};
// Two columns, time and level, as base/delimited_text.h reads them. Units stand in a first row of names
// (base/headings.h) and are converted; where they do not, times are in s and levels in `unit`, or in kV/mm
// if none is given. A level that is a voltage where `unit` is a field is a problem, and the other way round.
// Problems are added with `path` and say line and column.
PointTable read_points(std::string_view text, const std::string& path, std::optional<Unit> unit,
                       std::vector<Problem>& problems);

}  // namespace ferrobench::protocols
