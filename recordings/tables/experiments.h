// Which experiment stands behind each published table.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace ferrobench::recordings {

struct TableExperiment {
  std::string_view table;
  std::string_view protocol;  // of the library of field programs
  std::string_view specimen;  // of the library of models
  std::string_view key;       // the table's column with one run for each of its values; "" for a single run
  std::string_view
      setting;  // the run's setting that takes the value: "prestress_MPa", or a protocol parameter
  // The ramp rate, kV/mm/s, where the source's text (10) and captions (1) differ and the specimen's model was
  // fitted at the text's.
  std::optional<double> rate;
};

const TableExperiment& table_experiment(const std::string& table);  // Error(not_found)

}  // namespace ferrobench::recordings
