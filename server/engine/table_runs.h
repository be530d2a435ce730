// The runs behind a published table, on the virtual device.
#pragma once

#include <functional>

#include "recordings/tables/comparison.h"
#include "server/engine/request.h"

namespace ferrobench::server {

// What to run for a table: one run for each prestress or rate in it. `model` null: the
// shipped set of the table's specimen. `set` goes to every run and wins. Error(not_found) for another table.
std::vector<RunRequest> table_requests(const std::string& table, const nlohmann::json& model,
                                       const nlohmann::json& set, std::int64_t seed);

// Runs them side by side, as fast as possible, and compares. The recordings stay in `keep` ("": nowhere).
// `progress` is told the share that is done, and returns false to stop: Error(cancelled).
recordings::Comparison run_table(const std::string& table, const std::vector<RunRequest>& requests,
                                 const Store& store, const std::string& keep,
                                 const std::function<bool(double)>& progress);

}  // namespace ferrobench::server
