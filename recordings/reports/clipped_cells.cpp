#include "recordings/reports/clipped_cells.h"

#include <algorithm>

namespace ferrobench::recordings {

void mark_clipped(Table& table, const Clipping& clipping, const std::vector<std::string>& keys,
                  std::span<const Channel> channels, std::size_t first, std::size_t last) {
  for (const auto channel : channels) {
    if (!clipping.any(std::span(&channel, 1), first, last)) continue;
    for (const auto& key : keys) {
      const auto column = std::ranges::find(table.columns, key, &Column::key);
      const auto at = static_cast<std::size_t>(column - table.columns.begin());
      if (column != table.columns.end() &&
          !std::holds_alternative<std::monostate>(table.rows.back().at(at))) {
        table.clipped.emplace(table.rows.size() - 1, at);
        table.uncertainty.erase({table.rows.size() - 1, at});  // of what was cut off nothing is known
      }
    }
    const auto words = clipping.in_words(channel);
    if (std::ranges::find(table.cut_off, words) == table.cut_off.end()) table.cut_off.push_back(words);
  }
}

}  // namespace ferrobench::recordings
