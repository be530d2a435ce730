#include <filesystem>
#include <fstream>

#include "protocols/common/fields.h"
#include "recordings/difference.h"
#include "recordings/export.h"
#include "recordings/iso_time.h"
#include "recordings/recover.h"
#include "recordings/reports/report.h"
#include "server/engine/live.h"
#include "server/engine/text_table.h"
#include "server/methods/methods.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

struct RecordingRow {
  std::string name{}, title{}, protocol{}, model{}, device{}, start_time{}, status{}, reason{};
  double duration = 0;
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
  visit("status", r.status, {.doc = "running, complete, aborted, recovered or unreadable"});
  visit("reason", r.reason, {});
  visit("bytes", r.bytes, {.unit = "B"});
}
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
  std::int64_t max_points = 2000;
};
template <class Visitor>
void describe(Visitor& visit, ReadParams& p) {
  visit("name", p.name, {.required = true, .doc = "of a recording"});
  visit("first", p.first, {.min = 0, .doc = "row to begin with"});
  visit("rows", p.rows, {.min = 1, .doc = "absent: to the end"});
  visit("max_points", p.max_points,
        {.min = 1, .max = 20000, .doc = "more rows are joined to first, min and max; the file has them all"});
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
  visit("text", p.text, {.required = true});
  visit("time_s", p.time, {.unit = "s", .min = 0, .doc = "moment of the recording that it concerns"});
}
struct ImportParams {
  std::string name{};
  CsvImport import{};
};
template <class Visitor>
void describe(Visitor& visit, ImportParams& p) {
  visit("name", p.name, {.required = true, .doc = "of the new recording"});
  describe(visit, p.import);
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

RecordingRow row_of(const fs::path& path) {
  RecordingRow row{.name = path.stem().string()};
  std::error_code failure;
  row.bytes = static_cast<std::int64_t>(fs::file_size(recordings::present_file(path.string()), failure));
  try {
    const auto s = recordings::read_summary(path.string());
    row.title = s.header.title;
    row.protocol = text_at(s.header.protocol, "name");
    row.model = text_at(s.header.model, "name");
    row.device = text_at(s.header.device, "driver");
    row.start_time = s.header.start_time;
    row.duration = s.duration;
    row.rows = static_cast<std::int64_t>(s.rows);
    row.status = s.status;
    row.reason = s.reason;
  } catch (const Error& error) {
    row.status = "unreadable";
    row.reason = error.message();
  }
  return row;
}

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
          {"protocol", h.protocol},
          {"model", h.model},
          {"device", h.device}};
}

json columns_of(const fs::path& path, const ReadParams& p) {
  const auto recording = recordings::read_recording(path.string());
  const auto first = std::min<std::size_t>(static_cast<std::size_t>(p.first), recording.size());
  const auto rows = std::min<std::size_t>(p.rows ? static_cast<std::size_t>(*p.rows) : recording.size(),
                                          recording.size() - first);
  recordings::Rows part{.time = std::span(recording.time).subspan(first, rows), .channels = {}, .counts = {}};
  for (const auto channel : recordings::all_channels)
    if (recording.has(channel))
      part.channels.at(static_cast<std::size_t>(channel)) =
          std::span(recording.at(channel)).subspan(first, rows);
  auto out = decimate(part, static_cast<std::size_t>(p.max_points));
  out["rows"] = rows;
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

void add_changes(Dispatcher& rpc, Engine& engine) {
  rpc.add<RecordingName>(
      {.name = "recording.export",
       .doc = "Writes the samples as CSV beside the recording.",
       .role = Role::control},
      [&engine](const RecordingName& p) {
        const auto path = engine.store().recording(p.name);
        const auto out = fs::path(path).replace_extension(".csv");
        std::ofstream file(out);
        recordings::export_csv(recordings::read_recording(path.string()), file);
        file.close();
        if (!file) throw Error(ErrorCode::io_error, "the CSV file cannot be written");
        return Exported{out.filename().string(), out.string(), static_cast<std::int64_t>(fs::file_size(out))};
      });
  rpc.add<ImportParams>({.name = "recording.import",
                         .doc = "Makes a recording of a CSV text with a column map.",
                         .role = Role::control},
                        [&engine](const ImportParams& p) {
                          check_name(p.name, "/name");
                          const auto path = engine.store().recordings() / (p.name + ".h5");
                          if (Store::is_taken(path))
                            throw Error(
                                ErrorCode::busy, "a recording of this name is there already",
                                Problem{.path = "/name", .given = p.name, .hint = "choose another name"});
                          recordings::write_recording(path.string(), read_csv(p.import));
                          return row_of(path);
                        });
  rpc.add<AnnotateParams>(
      {.name = "recording.annotate", .doc = "Adds a note to a recording's events.", .role = Role::control},
      [&engine](const AnnotateParams& p) {
        const auto path = at_rest(engine, p.name);
        auto recording = recordings::read_recording(path.string());
        recording.events.push_back({p.time, "note", p.text});
        recordings::write_recording(path.string(), recording);
        return row_of(path);
      });
  rpc.add<RecoverParams>({.name = "recording.recover",
                          .doc = "Makes the files of runs that broke off, as each start of the daemon does.",
                          .role = Role::control},
                         [&engine](const RecoverParams& p) {
                           std::vector<std::string> paths;
                           if (p.name.empty())
                             paths = recordings::find_broken(engine.store().recordings().string());
                           else
                             paths.push_back(engine.store().recording(p.name).string());
                           RecoveryList out;
                           for (const auto& path : paths) out.recordings.push_back(recover(path));
                           return out;
                         });
  rpc.add<RecordingName>({.name = "recording.delete", .doc = "Deletes a recording.", .role = Role::control},
                         [&engine](const RecordingName& p) {
                           recordings::remove_recording(engine.store().recording(p.name).string());
                         });
}

}  // namespace

void add_recording_methods(Dispatcher& rpc, Engine& engine) {
  const json object{{"type", "object"}};
  rpc.add<NoParams>({.name = "recording.list", .doc = "The recordings of this bench."},
                    [&engine](const NoParams&) {
                      RecordingList out;
                      for (const auto& name : engine.store().recording_names())
                        out.recordings.push_back(row_of(engine.store().recordings() / (name + ".h5")));
                      return out;
                    });
  rpc.add<RecordingName>(
      {.name = "recording.info",
       .doc = "All that a recording says beside its samples.",
       .result_schema = object},
      [&engine](const RecordingName& p) { return info_of(engine.store().recording(p.name)); });
  rpc.add<ReadParams>(
      {.name = "recording.read",
       .doc = "Samples to draw, in SI: {time, <channel>: {first, min, max}}. For all of them, get the file.",
       .result_schema = object},
      [&engine](const ReadParams& p) { return columns_of(engine.store().recording(p.name), p); });
  rpc.add<ReportParams>({.name = "recording.report",
                         .doc = "Stroke, hysteresis, creep, rates and minor loops.",
                         .result_schema = object},
                        [&engine](const ReportParams& p) {
                          const auto format = recordings::format_from_name(p.format);
                          const auto recording =
                              recordings::read_recording(engine.store().recording(p.name).string());
                          auto content = render(make_report(recording), recording, format);
                          return format == recordings::Format::json ? json::parse(content)
                                                                    : json{{"content", std::move(content)}};
                        });
  rpc.add<RecordingPair>(
      {.name = "recording.compare",
       .doc = "Two recordings: rms, maximum and first difference of each channel, and what else differs.",
       .result_schema = object},
      [&engine](const RecordingPair& p) {
        return to_json(compare(recordings::read_recording(engine.store().recording(p.a).string()),
                               recordings::read_recording(engine.store().recording(p.b).string())));
      });
  add_changes(rpc, engine);
}

}  // namespace ferrobench::server
