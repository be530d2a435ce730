// What a recording shows, as tables: stroke, hysteresis, the mean of a repeat, creep, rates, minor loops,
// pulses, the small-signal response, leakage and fatigue; and the whole as text, Markdown, CSV, JSON or one
// self-contained HTML page with pictures.
//
// A table that the recording has nothing for (no hold, one rate only, no such channel) is left out.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "recordings/format/recording.h"
#include "recordings/reports/analysis.h"
#include "recordings/reports/table.h"

namespace ferrobench::recordings {

struct Report {
  std::string title;
  std::vector<std::pair<std::string, std::string>> facts;  // specimen, load, status, ...
  std::vector<Table> tables;
  std::shared_ptr<const Analysis> analysis;  // behind the tables, for the pictures
};

// The recording outlives the report.
Report make_report(const Recording& recording);
Report make_report(Recording&&) = delete;
// HTML draws its pictures with gnuplot; without it the page says so in their place.
std::string render(const Report& report, Format format);

// The tables one by one, of a recording or of what is known of it already.
std::optional<Table> stroke_table(const Analysis& analysis);
std::optional<Table> hysteresis_table(const Analysis& analysis);
std::optional<Table> creep_table(const Recording& recording);
// Displacement and polarization as they creep, one table each.
std::vector<Table> creep_readings(const Analysis& analysis);
std::optional<Table> mean_table(const Analysis& analysis);  // of the passes of a repeat
std::optional<Table> rate_table(const Analysis& analysis);
std::optional<Table> minor_loop_table(const Analysis& analysis);
std::optional<Table> pulse_table(const Analysis& analysis);  // positive-up-negative-down, pulse by pulse
std::optional<Table> pund_table(const Analysis& analysis);   // and cycle by cycle
// Beside what the tester that measured it states, where an import kept that.
std::optional<Table> pund_tester_table(const Analysis& analysis);
std::optional<Table> small_signal_table(const Analysis& analysis);  // bias by bias
std::optional<Table> leakage_table(
    const Recording& recording);  // a current, and no charge that it would be of
std::optional<Table> fatigue_table(const Recording& recording);  // a tester's readings between cycles

}  // namespace ferrobench::recordings
