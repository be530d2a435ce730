#include "recordings/reports/report.h"

#include <algorithm>
#include <utility>

#include "base/fields.h"
#include "base/number_text.h"
#include "base/units.h"
#include "base/visible.h"
#include "recordings/analysis/skew.h"
#include "recordings/reports/html_page.h"

namespace ferrobench::recordings {
namespace {

void add_fact(Report& report, const std::string& name, const std::string& value) {
  if (!value.empty()) report.facts.emplace_back(name, value);
}

// Films are nanometres thick, stacks are centimetres long.
std::string size_text(double metres) {
  if (metres >= 1e-4) return number_text(metres * 1e3) + " mm";
  return metres >= 1e-6 ? number_text(metres / metre_in_um) + " µm" : number_text(metres * 1e9) + " nm";
}

std::string layers_text(const Specimen& specimen) {
  const auto thickness = specimen.layer_thickness < 1e-6
                             ? size_text(specimen.layer_thickness)
                             : number_text(specimen.layer_thickness / metre_in_um) + " µm";
  return std::to_string(specimen.layer_count) + (specimen.layer_count == 1 ? " layer of " : " layers of ") +
         thickness;
}

Table event_table(const Recording& r) {
  Table table{.key = "events",
              .title = "Events",
              .columns = {{"time_s", "time", "s"}, {"kind", "kind", ""}, {"message", "message", ""}},
              .rows = {},
              .notes = {}};
  for (const auto& event : r.events) table.rows.push_back({cell(event.time), event.kind, event.message});
  return table;
}

std::string with_facts(const Report& report, const std::string& before, const std::string& between,
                       const std::function<std::string(std::string_view)>& clean) {
  std::string out;
  for (const auto& [name, value] : report.facts)
    out.append(before).append(name).append(between).append(clean(value)).append("\n");
  return out;
}

nlohmann::json as_json(const Report& report) {
  nlohmann::json out{{"title", report.title},
                     {"facts", nlohmann::json::object()},
                     {"order", {{"facts", nlohmann::json::array()}, {"tables", nlohmann::json::array()}}}};
  for (const auto& [name, value] : report.facts) {
    out["facts"][name] = value;
    out["order"]["facts"].push_back(name);
  }
  for (const auto& table : report.tables) {
    out[table.key] = to_json(table);
    out["order"]["tables"].push_back(table.key);
  }
  return out;
}

// Of a copy whose channels are brought to the time of their row.
std::shared_ptr<const Analysis> aligned(const Recording& recording) {
  struct Own {
    explicit Own(Recording r) : recording(std::move(r)) {}
    Recording recording;
    Analysis analysis{recording};
  };
  const auto own = std::make_shared<Own>(recording);
  remove_skew(own->recording);
  return {own, &own->analysis};
}

}  // namespace

Report make_report(const Recording& recording) {
  const auto skews = skew_of(recording.header.device);
  const double skew = *std::ranges::max_element(skews);
  const auto shared = skew > 0 ? aligned(recording) : std::make_shared<const Analysis>(recording);
  const auto& analysis = *shared;
  const Recording& r = analysis.recording;
  const auto& h = r.header;
  Report report{
      .title = h.title.empty() ? "Recording" : h.title, .facts = {}, .tables = {}, .analysis = shared};
  add_fact(report, "status", r.reason.empty() ? r.status : r.status + " (" + r.reason + ")");
  add_fact(report, "start", h.start_time);
  if (r.size() > 1)
    add_fact(report, "length",
             number_text(r.time.back() - r.time.front()) + " s, " + std::to_string(r.size()) + " samples");
  add_fact(report, "protocol", text_at(h.protocol, "name"));
  add_fact(report, "model", text_at(h.model, "name"));
  add_fact(report, "device", text_at(h.device, "driver"));
  if (skew > 0)
    add_fact(report, "channels",
             "read up to " + number_text(skew * 1e6) + " µs after their row, brought back to it");
  add_fact(report, "specimen",
           (h.specimen.name.empty() ? "" : h.specimen.name + ": ") + size_text(h.specimen.length) +
               " long, " + number_text(h.specimen.area * 1e6) + " mm², " + layers_text(h.specimen));
  add_fact(report, "load",
           "prestress " + number_text(h.load.prestress / pascal_in_mpa) + " MPa, spring " +
               number_text(h.load.spring_stiffness / newton_per_m_in_n_per_um) + " N/µm");
  if (h.past.known()) add_fact(report, "before", protocols::in_words(h.past));
  add_fact(report, "identifier", h.entry_identifier);
  const auto add = [&](const std::optional<Table>& table) {
    if (table) report.tables.push_back(*table);
  };
  for (const auto& table :
       {small_signal_table(analysis), mean_table(analysis), stroke_table(analysis),
        hysteresis_table(analysis), rate_table(analysis), minor_loop_table(analysis), creep_table(r)})
    add(table);
  for (const auto& table : creep_readings(analysis)) report.tables.push_back(table);
  for (const auto& table : {pund_table(analysis), pund_tester_table(analysis), pulse_table(analysis),
                            leakage_table(r), fatigue_table(r)})
    add(table);
  if (!r.events.empty()) report.tables.push_back(event_table(r));
  return report;
}

std::string render(const Report& report, Format format) {
  std::string out;
  switch (format) {
    case Format::text:
      out = visible(report.title) + '\n' + with_facts(report, "  ", ": ", visible);
      for (const auto& table : report.tables) out += '\n' + to_text(table);
      return out;
    case Format::md:
      out = "# " + escape_markdown(report.title) + "\n\n" + with_facts(report, "- ", ": ", escape_markdown);
      for (const auto& table : report.tables) out += '\n' + to_markdown(table);
      return out;
    case Format::csv:
      for (const auto& table : report.tables)
        out += (out.empty() ? "# " : "\n# ") + visible(table.title) + '\n' + to_csv(table);
      return out;
    case Format::json:
      return as_json(report).dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + '\n';
    case Format::html:
      return html_page(report);
  }
  return out;
}

}  // namespace ferrobench::recordings
