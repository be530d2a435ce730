// Marks the values of a table that are made of samples which a converter cut off.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "recordings/analysis/clipping.h"
#include "recordings/reports/table.h"

namespace ferrobench::recordings {

// Of the table's last row, the columns given by their keys, if one of the samples first..last of these
// channels is clipped; the table's note names the channels.
void mark_clipped(Table& table, const Clipping& clipping, const std::vector<std::string>& keys,
                  std::span<const Channel> channels, std::size_t first, std::size_t last);

}  // namespace ferrobench::recordings
