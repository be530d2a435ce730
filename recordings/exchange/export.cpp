#include "recordings/exchange/export.h"

#include <cmath>
#include <ostream>

#include "base/number_text.h"

namespace ferrobench::recordings {
namespace {

struct NamedColumn {
  std::string name;
  const std::vector<double>* values;
};

std::vector<NamedColumn> columns_of(const Recording& r) {
  std::vector<NamedColumn> out{{"time_s", &r.time}};
  for (const auto channel : all_channels) {
    if (!r.has(channel)) continue;
    const auto unit = channel_unit(channel) == "V/m" ? "V_per_m" : std::string(channel_unit(channel));
    out.push_back({std::string(channel_name(channel)) + "_" + unit, &r.at(channel)});
  }
  return out;
}

}  // namespace

void export_csv(const Recording& recording, std::ostream& out) {
  const auto columns = columns_of(recording);
  std::string line;
  for (const auto& column : columns) line += (line.empty() ? "" : ",") + column.name;
  out << line << '\n';
  for (std::size_t i = 0; i < recording.size(); ++i) {
    line.clear();
    for (const auto& column : columns) {
      if (&column != columns.data()) line += ',';
      if (std::isfinite((*column.values)[i])) line += number_in_full((*column.values)[i]);
    }
    line += '\n';
    out << line;
  }
}

void export_json(const Recording& recording, std::ostream& out) {
  const auto& h = recording.header;
  nlohmann::json head{{"title", h.title},
                      {"status", recording.status},
                      {"start_time", h.start_time},
                      {"entry_identifier", h.entry_identifier},
                      {"sample", to_json(h.specimen)},
                      {"load", to_json(h.load)},
                      {"past", to_json(h.past)},
                      {"segments", nlohmann::json::array()},
                      {"events", nlohmann::json::array()}};
  for (const auto& s : recording.segments)
    head["segments"].push_back({{"start_sample", s.start_sample},
                                {"end_sample", s.end_sample},
                                {"kind", s.kind},
                                {"label", s.label},
                                {"level_V_per_m", s.level},
                                {"rate_V_per_m_s", s.rate}});
  for (const auto& e : recording.events)
    head["events"].push_back({{"time_s", e.time}, {"kind", e.kind}, {"message", e.message}});
  // The columns are written one by one: as JSON values they would take many times their size in memory.
  auto text = head.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  text.pop_back();
  out << text << ",\"columns\":{";
  const auto columns = columns_of(recording);
  for (const auto& column : columns) {
    out << (&column == columns.data() ? "\"" : ",\"") << column.name << "\":[";
    for (std::size_t i = 0; i < column.values->size(); ++i) {
      const double value = (*column.values)[i];
      out << (i > 0 ? "," : "") << (std::isfinite(value) ? number_in_full(value) : "null");
    }
    out << ']';
  }
  out << "}}\n";
}

}  // namespace ferrobench::recordings
