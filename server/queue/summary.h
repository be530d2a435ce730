// A plan at a glance: any figure of its recordings' reports against what was swept, run by run and as means
// over the repeats, as a table and as a picture.
#pragma once

#include <string>
#include <vector>

#include "recordings/reports/table.h"
#include "server/queue/ledger.h"

namespace ferrobench::server {

// A recording's report has a table of several rows, cycle by cycle: which of them, or what of them.
enum class FigureOf { mean, first, last, min, max };
std::span<const std::pair<FigureOf, std::string_view>> enum_names(FigureOf);

struct SummaryRequest {
  std::int64_t plan = 0;
  std::vector<std::string> figures{};
  FigureOf of = FigureOf::mean;
  std::string format = "json";
};
template <class Visitor>
void describe(Visitor& visit, SummaryRequest& r) {
  visit("plan", r.plan, {.min = 1, .required = true, .doc = "its id"});
  visit(
      "figures", r.figures,
      {.doc =
           "of a report, TABLE.COLUMN, for example stroke.stroke_um; none: those of strokes and hysteresis"});
  visit("of", r.of, {.doc = "what is taken of a table with several rows"});
  visit("format", r.format, {.doc = "json; text, md, csv and html, which has a picture, give {content}"});
}

struct PlanSummary {
  std::string title{};
  recordings::Table runs{};
  std::optional<recordings::Table> means{};  // where there are repeats
  std::vector<std::string> known{};          // figures that can be asked for
  struct Curve {
    std::string label{};
    std::vector<std::array<double, 2>> points{};
  };
  struct Picture {
    std::string x{}, y{};
    std::vector<Curve> curves{};
  };
  std::vector<Picture> pictures{};  // one a figure, against the first sweep of numbers
};

// Numbers of the report of a recording: {"stroke.stroke_um": {title, unit, rows, mean, first, last, min,
// max}}. Throws Error as reading it does.
nlohmann::json figures_of(const std::string& recording_path);
// Reads the reports of recordings that were not read before. Error(not_found), Error(invalid_params) for a
// figure that no recording has, once there is one.
PlanSummary summarize(const SummaryRequest& request, Ledger& ledger, const Store& store);
nlohmann::json render(const PlanSummary& summary, const std::string& format);

}  // namespace ferrobench::server
