#include "recordings/tables/experiments.h"

#include <array>

#include "recordings/tables/published.h"

namespace ferrobench::recordings {
namespace {

constexpr std::array<TableExperiment, 4> experiments{
    {{"3.10", "creep-16-holds-spring", "nec-ae0505d08", "", "", std::nullopt},
     {"3.11", "creep-6-holds-fast", "nec-ae0505d08", "prestress_MPa", "prestress_MPa", 10},
     {"3.12", "creep-6-holds-fast", "nec-ae0505d08", "prestress_MPa", "prestress_MPa", 10},
     {"3.13", "stage-stroke-against-rate", "mcl-op30", "rate_V_per_s", "rate", std::nullopt}}};

}  // namespace

const TableExperiment& table_experiment(const std::string& table) {
  for (const auto& e : experiments)
    if (e.table == table) return e;
  published_table(table);  // names the tables there are
  return experiments.front();
}

}  // namespace ferrobench::recordings
