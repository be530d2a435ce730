// The report as one HTML page that needs nothing else: no script, no font, no address outside itself.
#pragma once

#include <string>

#include "recordings/reports/report.h"

namespace ferrobench::recordings {

std::string html_page(const Report& report);
// A page of tables alone.
std::string html_frame(const std::string& title, const std::string& body);

}  // namespace ferrobench::recordings
