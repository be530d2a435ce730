// Recordings as rows of a list, for every method that names some.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/fields.h"

namespace ferrobench::server {

struct RecordingRow {
  std::string name{}, title{}, protocol{}, model{}, device{}, start_time{}, status{}, reason{};
  double duration = 0;
  std::optional<double> spring{}, prestress{};
  std::int64_t rows = 0, bytes = 0;
};
template <class Visitor>
void describe(Visitor& visit, RecordingRow& r) {
  visit("name", r.name, {.required = true, .doc = "the file is at /recordings/<name>"});
  visit("title", r.title, {});
  visit("protocol", r.protocol, {});
  visit("model", r.model, {});
  visit("device", r.device, {.doc = "driver"});
  visit("start_time", r.start_time, {.doc = "ISO 8601"});
  visit("duration_s", r.duration, {.unit = "s"});
  visit("rows", r.rows, {});
  visit("status", r.status, {.doc = "running, broken_off, complete, aborted, recovered or unreadable"});
  visit("reason", r.reason, {});
  visit("spring_stiffness_N_per_m", r.spring, {.unit = "N/m"});
  visit("prestress_Pa", r.prestress, {.unit = "Pa", .doc = "compressive is positive"});
  visit("bytes", r.bytes, {.unit = "B"});
}

// A table of a report as JSON: rows by the keys of its columns.
nlohmann::json table_schema();

std::vector<RecordingRow> rows_of(const std::vector<std::string>& paths);

}  // namespace ferrobench::server
