#include <filesystem>

#include "base/fields.h"
#include "recordings/analysis/difference.h"
#include "recordings/analysis/thinning.h"
#include "recordings/disk/new_file.h"
#include "recordings/exchange/export.h"
#include "recordings/file/reader.h"
#include "recordings/file/recover.h"
#include "recordings/file/writer.h"
#include "recordings/format/iso_time.h"
#include "recordings/reports/report.h"
#include "server/engine/average.h"
#include "server/engine/live.h"
#include "server/methods/methods.h"
#include "server/methods/recording_curves.h"
#include "server/methods/recording_rows.h"
#include "server/rpc/schemas.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

struct RecordingList {
  std::vector<RecordingRow> recordings{};
};
template <class Visitor>
void describe(Visitor& visit, RecordingList& l) {
  visit("recordings", l.recordings, {.required = true, .doc = "newest first"});
}

struct RecordingName {
  std::string name{};
};
template <class Visitor>
void describe(Visitor& visit, RecordingName& p) {
  visit("name", p.name, {.required = true, .doc = "of a recording"});
}
struct RecordingPair {
  std::string a{}, b{};
};
template <class Visitor>
void describe(Visitor& visit, RecordingPair& p) {
  visit("a", p.a, {.required = true, .doc = "name of a recording"});
  visit("b", p.b, {.required = true, .doc = "name of the other"});
}
struct ReadParams {
  std::string name{};
  std::int64_t first = 0;
  std::optional<std::int64_t> rows{};
  std::int64_t max_points = 2000, pixels = 1000;
  std::vector<std::string> axes{};
};
template <class Visitor>
void describe(Visitor& visit, ReadParams& p) {
  visit("name", p.name, {.required = true, .doc = "of a recording"});
  visit("first", p.first, {.min = 0, .doc = "row to begin with"});
  visit("rows", p.rows, {.min = 1, .doc = "absent: to the end"});
  visit("max_points", p.max_points,
        {.min = 1, .max = 20000, .doc = "more rows are joined to first, min and max; the file has them all"});
  visit(
      "axes", p.axes,
      {.doc =
           "two of time and the channels, for example field and displacement: curves cycle by cycle, thinned "
           "by their length in these axes; time_in_hold and a channel: the change since the start of each "
           "long "
           "hold; absent: every channel against time"});
  visit("pixels", p.pixels,
        {.min = 10, .max = 10000, .doc = "of the picture's sides: curves are true to half of one"});
}
struct ReportParams {
  std::string name{}, format = "json";
};
template <class Visitor>
void describe(Visitor& visit, ReportParams& p) {
  visit("name", p.name, {.required = true, .doc = "of a recording"});
  visit("format", p.format, {.doc = "json gives the report itself; text, md, csv and html give {content}"});
}
struct AnnotateParams {
  std::string name{}, text{};
  double time = 0;
};
template <class Visitor>
void describe(Visitor& visit, AnnotateParams& p) {
  visit("name", p.name, {.required = true, .doc = "of a recording"});
  visit("text", p.text, {.required = true, .doc = "the note"});
  visit("time_s", p.time, {.unit = "s", .min = 0, .doc = "moment of the recording that it concerns"});
}
struct Averaged {
  std::string recording{}, path{};
  std::vector<std::int64_t> passes{};
  std::vector<std::string> left_out{};
};
template <class Visitor>
void describe(Visitor& visit, Averaged& a) {
  visit("recording", a.recording, {.required = true, .doc = "name of the mean"});
  visit("path", a.path, {.required = true});
  visit("passes", a.passes, {.required = true, .doc = "that have a part in it"});
  visit("left_out", a.left_out, {.required = true, .doc = "why other passes have none"});
}
struct RecoverParams {
  std::string name{};
};
template <class Visitor>
void describe(Visitor& visit, RecoverParams& p) {
  visit("name", p.name, {.doc = "of a recording; \"\": every one whose run broke off"});
}
struct RecoveryRow {
  std::string name{}, outcome{}, message{};
  std::int64_t rows = 0;
};
template <class Visitor>
void describe(Visitor& visit, RecoveryRow& r) {
  visit("name", r.name, {.required = true});
  visit("outcome", r.outcome,
        {.required = true, .doc = "recovered, completed, already_whole, nothing, running or failed"});
  visit("message", r.message, {.doc = "what was done"});
  visit("rows", r.rows, {.min = 0, .doc = "that the recording has"});
}
struct RecoveryList {
  std::vector<RecoveryRow> recordings{};
};
template <class Visitor>
void describe(Visitor& visit, RecoveryList& l) {
  visit("recordings", l.recordings, {.required = true});
}
struct Exported {
  std::string name{}, path{};
  std::int64_t bytes = 0;
};
template <class Visitor>
void describe(Visitor& visit, Exported& e) {
  visit("name", e.name, {.doc = "the file is at /recordings/<name>"});
  visit("path", e.path, {.doc = "on the daemon's machine"});
  visit("bytes", e.bytes, {.unit = "B"});
}

const std::vector<ErrorCode> view_errors{ErrorCode::not_found, ErrorCode::bad_recording,
                                         ErrorCode::limit_exceeded, ErrorCode::io_error,
                                         ErrorCode::cancelled};
const std::vector<ErrorCode> change_errors{ErrorCode::not_found, ErrorCode::busy,
                                           ErrorCode::bad_state, ErrorCode::bad_recording,
                                           ErrorCode::io_error,  ErrorCode::disk_full};
const std::vector<ErrorCode> new_errors{ErrorCode::not_found, ErrorCode::bad_recording,
                                        ErrorCode::limit_exceeded, ErrorCode::io_error, ErrorCode::disk_full};

json info_of(const fs::path& path) {
  const auto s = recordings::read_summary(path.string());
  json channels = json::array();
  for (const auto channel : s.channels) channels.push_back(recordings::channel_name(channel));
  const auto& h = s.header;
  return {{"name", path.stem().string()},
          {"path", path.string()},
          {"title", h.title},
          {"status", s.status},
          {"reason", s.reason},
          {"start_time", h.start_time},
          {"end_time", s.end_time},
          {"identifier", h.entry_identifier},
          {"run_seed", h.run_seed ? json(*h.run_seed) : json(nullptr)},
          {"rows", s.rows},
          {"duration_s", s.duration},
          {"channels", channels},
          {"segments", s.segment_count},
          {"events", s.event_count},
          {"specimen", to_json(h.specimen)},
          {"load", to_json(h.load)},
          {"past", to_json(h.past)},
          {"protocol", h.protocol},
          {"model", h.model},
          {"device", h.device}};
}

// All of a recording, for a view of it; what is too long for that is the file's business. So no view takes
// more than this memory, and the time that goes with it.
recordings::Recording read_to_view(Engine& engine, const std::string& name) {
  constexpr std::uint64_t most_bytes = std::uint64_t{1} << 30;
  constexpr double with_counts = 1.5;  // what it has beside the channels is a fraction of them
  const auto path = engine.store().recording(name).string();
  const auto summary = recordings::read_summary(path);
  const auto row = sizeof(double) * (1 + summary.channels.size());
  if (summary.rows > most_bytes / row)
    throw Error(
        ErrorCode::limit_exceeded, "the recording is too long to be looked at here",
        Problem{.path = "/name",
                .message = "has too many rows",
                .given = summary.rows,
                .allowed = {{"to", most_bytes / row}},
                .unit = "rows",
                .hint = "get the file, /recordings/" + name + ".h5, and look at it with your own program"});
  return recordings::read_recording(path, with_counts * static_cast<double>(most_bytes));
}

json columns_of(Engine& engine, const ReadParams& p) {
  const auto recording = read_to_view(engine, p.name);
  const auto first = std::min<std::size_t>(static_cast<std::size_t>(p.first), recording.size());
  const auto rows = std::min<std::size_t>(p.rows ? static_cast<std::size_t>(*p.rows) : recording.size(),
                                          recording.size() - first);
  if (!p.axes.empty())
    return curves_of(recording, p.axes, first, rows, static_cast<std::size_t>(p.pixels),
                     static_cast<std::size_t>(p.max_points));
  recordings::Rows part{.time = std::span(recording.time).subspan(first, rows), .channels = {}, .counts = {}};
  for (const auto channel : recordings::all_channels)
    if (recording.has(channel))
      part.channels.at(static_cast<std::size_t>(channel)) =
          std::span(recording.at(channel)).subspan(first, rows);
  const auto begins = recordings::stretches(part.time, static_cast<std::size_t>(p.max_points));
  auto out = decimate(part, begins);
  out["rows"] = rows;
  for (const auto begin : begins) out["row"].push_back(first + begin);
  out["segments"] = segment_rows(recording);
  return out;
}

// One that cannot be recovered keeps none of the others from it.
RecoveryRow recover(const std::string& path) {
  RecoveryRow row{.name = fs::path(path).stem().string()};
  try {
    const auto done = recordings::recover_recording(path);
    row.outcome = recovered_name(done.outcome);
    row.message = done.message;
    row.rows = static_cast<std::int64_t>(done.rows);
  } catch (const Error& error) {
    row.outcome = "failed";
    row.message = error.what();
  }
  return row;
}

// Rewriting needs a file that nobody else writes.
fs::path at_rest(Engine& engine, const std::string& name) {
  auto path = engine.store().recording(name);
  const auto journal = recordings::journal_state(path.string());
  if (engine.is_being_written(path) || journal == recordings::JournalState::being_written)
    throw Error(ErrorCode::busy, "this recording is being written",
                Problem{.path = "/name", .given = name, .hint = "wait for the end of its run"});
  if (journal == recordings::JournalState::left && !fs::exists(path))
    throw Error(ErrorCode::bad_state, "the run of this recording broke off",
                Problem{.path = "/name", .given = name, .hint = "recording.recover makes its file"});
  return path;
}

// Of what info_of() gives.
json info_schema() {
  using namespace schema;
  return object({{"name", text()},
                 {"path", text("on the daemon's machine")},
                 {"title", text()},
                 {"status", text("running, complete, aborted or recovered")},
                 {"reason", text()},
                 {"start_time", text("ISO 8601")},
                 {"end_time", text("ISO 8601")},
                 {"identifier", text()},
                 {"run_seed", or_null(whole())},
                 {"rows", whole()},
                 {"duration_s", number("s")},
                 {"channels", list_of(text())},
                 {"segments", whole("how many")},
                 {"events", whole("how many")},
                 {"specimen", any_object()},
                 {"load", any_object()},
                 {"past", any_object("what the specimen had been through before the first sample")},
                 {"protocol", or_null(any_object())},
                 {"model", or_null(any_object())},
                 {"device", or_null(any_object("what it says of itself"))}});
}

// A report: its tables beside its facts.
json report_schema() {
  using namespace schema;
  return object({{"title", text()},
                 {"facts", map_of(text())},
                 {"order", object({{"facts", list_of(text())}, {"tables", list_of(text())}})},
                 {"content", text("the whole report, in a format other than json")}},
                table_schema());
}

json comparison_schema() {
  using namespace schema;
  const auto values = list_of(object({{"place", text("in the file")}, {"a", any()}, {"b", any()}}));
  return object(
      {{"same_samples", truth()},
       {"by_time", truth("the rows' times differ: rms, mean and maximum are at common times")},
       {"note", text("what to know of that; \"\" where rows are compared one by one")},
       {"columns",
        list_of(object(
            {{"dataset", text("in the file")},
             {"unit", text()},
             {"in_a", truth()},
             {"in_b", truth()},
             {"rows_a", whole()},
             {"rows_b", whole()},
             {"rms", or_null(number("", "in the unit"))},
             {"mean", or_null(number("", "of b - a, in the unit"))},
             {"maximum", or_null(number("", "in the unit"))},
             {"unequal", whole("rows")},
             {"identical", truth()},
             {"first", object({{"row", whole()}, {"a", or_null(number())}, {"b", or_null(number())}})}}))},
       {"tables", values},
       {"header", values}});
}

void add_changes(Dispatcher& rpc, Engine& engine) {
  rpc.add<RecordingName>(
      {.name = "recording.export",
       .doc = "Writes the samples as CSV beside the recording.",
       .role = Role::control,
       .lane = Lane::heavy,
       .errors = change_errors},
      [&engine](const RecordingName& p) {
        const auto path = engine.store().recording(p.name);
        const auto out = fs::path(path).replace_extension(".csv");
        recordings::NewFile file(out.string(), recordings::Existing::replace);
        recordings::FileStream text(file);
        recordings::export_csv(recordings::read_recording(path.string()), text);
        text.flush();
        file.put();
        return Exported{out.filename().string(), out.string(), static_cast<std::int64_t>(fs::file_size(out))};
      });
  rpc.add<RecordingName>(
      {.name = "recording.average",
       .doc =
           "The mean over the passes of the protocol's averaged repeat, but the first, as a new recording.",
       .role = Role::control,
       .lane = Lane::heavy,
       .errors = new_errors},
      [&engine](const RecordingName& p) {
        const auto mean = average_recording(read_to_view(engine, p.name));
        const auto path = engine.store().add_recording(p.name + "-mean", mean.recording);
        return Averaged{
            path.stem().string(), path.string(), {mean.passes.begin(), mean.passes.end()}, mean.left_out};
      });
  rpc.add<AnnotateParams>({.name = "recording.annotate",
                           .doc = "Adds a note to a recording's events.",
                           .role = Role::control,
                           .lane = Lane::heavy,
                           .errors = change_errors},
                          [&engine](const AnnotateParams& p) {
                            const auto path = at_rest(engine, p.name);
                            recordings::change_recording(
                                path.string(), [&p](recordings::Recording& recording) {
                                  recording.events.push_back({p.time, "note", p.text});
                                });
                            return rows_of({path.string()}).front();
                          });
  rpc.add<RecoverParams>({.name = "recording.recover",
                          .doc = "Makes the files of runs that broke off, as each start of the daemon does.",
                          .role = Role::control,
                          .lane = Lane::heavy,
                          .errors = change_errors},
                         [&engine](const RecoverParams& p) {
                           std::vector<std::string> paths;
                           if (p.name.empty()) {
                             recordings::remove_leftovers(engine.store().folder().string());
                             paths = recordings::find_broken(engine.store().recordings().string());
                           } else {
                             paths.push_back(engine.store().recording(p.name).string());
                           }
                           RecoveryList out;
                           for (const auto& path : paths) out.recordings.push_back(recover(path));
                           return out;
                         });
  rpc.add<RecordingName>({.name = "recording.delete",
                          .doc = "Deletes a recording.",
                          .role = Role::control,
                          .errors = change_errors},
                         [&engine](const RecordingName& p) {
                           recordings::remove_recording(engine.store().recording(p.name).string());
                         });
}

}  // namespace

void add_recording_methods(Dispatcher& rpc, Engine& engine) {
  rpc.add<NoParams>({.name = "recording.list",
                     .doc = "The recordings of this bench.",
                     .lane = Lane::heavy,
                     .errors = {ErrorCode::io_error}},
                    [&engine](const NoParams&) {
                      std::vector<std::string> paths;
                      for (const auto& name : engine.store().recording_names())
                        paths.push_back((engine.store().recordings() / (name + ".h5")).string());
                      return RecordingList{rows_of(paths)};
                    });
  rpc.add<RecordingName>(
      {.name = "recording.info",
       .doc = "All that a recording says beside its samples.",
       .lane = Lane::heavy,
       .errors = view_errors,
       .result_schema = info_schema()},
      [&engine](const RecordingName& p) { return info_of(engine.store().recording(p.name)); });
  rpc.add<ReadParams>({.name = "recording.read",
                       .doc = "Samples to draw, in SI: {time, <channel>: {first, min, max}}, or the curves "
                              "in two axes. For all of "
                              "them, get the file.",
                       .lane = Lane::heavy,
                       .errors = view_errors,
                       .result_schema = curves_schema()},
                      [&engine](const ReadParams& p) { return columns_of(engine, p); });
  rpc.add<ReportParams>({.name = "recording.report",
                         .doc = "Stroke, hysteresis, creep, rates, minor loops, pulses and the small-signal "
                                "response.",
                         .lane = Lane::heavy,
                         .errors = view_errors,
                         .result_schema = report_schema()},
                        [&engine](const ReportParams& p) {
                          const auto format = recordings::format_from_name(p.format);
                          const auto recording = read_to_view(engine, p.name);
                          auto content = render(make_report(recording), format);
                          return format == recordings::Format::json ? json::parse(content)
                                                                    : json{{"content", std::move(content)}};
                        });
  rpc.add<RecordingPair>(
      {.name = "recording.compare",
       .doc = "Two recordings: rms, maximum and first difference of each channel, and what else differs.",
       .lane = Lane::heavy,
       .errors = view_errors,
       .result_schema = comparison_schema()},
      [&engine](const RecordingPair& p) {
        return to_json(compare(read_to_view(engine, p.a), read_to_view(engine, p.b)));
      });
  add_changes(rpc, engine);
}

}  // namespace ferrobench::server
