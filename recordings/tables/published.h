// The tables of the source, as published: what was measured there, to set beside what is measured here.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace ferrobench::recordings {

// One published value. quantity and keys are named as in the table's CSV file, units included.
struct PublishedCell {
  std::string quantity;                              // "displacement_change_um"
  std::vector<std::pair<std::string, double>> keys;  // {"prestress_MPa", 4}, {"field_kV_per_mm", -0.45}
  double published = 0;
  bool doubtful = false;  // the print does not read clearly
  double key(std::string_view name) const;
};

struct PublishedTable {
  std::string name;  // "3.11"
  std::string title;
  std::vector<PublishedCell> cells;
};

std::vector<std::string> published_table_names();
PublishedTable published_table(const std::string& name);  // Error(not_found)

}  // namespace ferrobench::recordings
