// The tables of the source, as published: what was measured there, to set beside what is measured here. The
// tables are the files of this folder; nothing else knows their numbers.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "recordings/tables/description.h"

namespace ferrobench::recordings {

// One published value. quantity and keys are named as in the table's CSV file, units included.
struct PublishedCell {
  std::string quantity;                              // "displacement_change_um"
  std::vector<std::pair<std::string, double>> keys;  // {"prestress_MPa", 4}, {"field_kV_per_mm", -0.45}
  double published = 0;
  bool doubtful = false;   // the print does not read clearly
  double uncertainty = 1;  // standard deviation of its logarithm
  double key(std::string_view name) const;
};

struct PublishedTable {
  std::string name;  // "3.11"
  std::string title;
  TableDescription description;
  std::vector<PublishedCell> cells;

  const TableQuantity& quantity_of(const PublishedCell& cell) const;
  // The key whose values have a run each, and these; null and none if there is a single run.
  const TableKey* run_key() const;
  std::vector<double> run_values() const;
};

std::vector<std::string> published_table_names();         // {"3.10", ...}
std::string published_tables_in_words();                  // "3.10, 3.11 or 3.12"
PublishedTable published_table(const std::string& name);  // Error(not_found)

}  // namespace ferrobench::recordings
