// A discovery as JSON, in words, and as one page that a person of the lab understands without statistics.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "model/inference/study/discover.h"

namespace ferrobench::model {

// The findings in the order of the report, one sentence or two each: verdict, places, proof, alternatives,
// what else moved.
std::vector<std::string> findings(const Discovery& discovery);
// As text for a terminal.
std::string text_report(const Discovery& discovery);
// Everything, with the findings.
nlohmann::json to_json(const Discovery& discovery);
// One self-contained HTML page with pictures of measured, before and after.
std::string html_report(const Discovery& discovery);

}  // namespace ferrobench::model
