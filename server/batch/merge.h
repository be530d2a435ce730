// All results of a batch together: one table, as CSV and HDF5, and a page that says what stands out in the
// fleet.
#pragma once

#include <string>
#include <vector>

#include "recordings/reports/table.h"
#include "server/batch/work.h"

namespace ferrobench::batch {

struct ItemResult {
  std::string id;
  nlohmann::json result;  // null: missing
};

// A row for each of a result's rows, in the order of the items; one for what failed or is missing.
recordings::Table merged_table(Kind kind, const std::vector<ItemResult>& results);

// Of the columns of numbers: how many, median, spread (1.4826 times the median of the distances from it: the
// standard deviation of a normal distribution), lowest, highest.
recordings::Table fleet_table(const recordings::Table& merged);
// Further from the median than 3.5 spreads (Iglewicz and Hoaglin, How to Detect and Handle Outliers, 1993),
// of at least 5 numbers; furthest first.
recordings::Table outlier_table(const recordings::Table& merged);
// Of a discovery: how often each effect was named, and in which items.
recordings::Table effects_table(const std::vector<ItemResult>& results);

// Puts table.csv, table.h5 and index.html there. Error(bad_state) if results are of different commits.
void put_merged(Kind kind, const std::vector<ItemResult>& results, const BatchFolder& folder);

}  // namespace ferrobench::batch
