#include <filesystem>

#include "recordings/exchange/import.h"
#include "recordings/file/writer.h"
#include "server/methods/methods.h"
#include "server/methods/recording_rows.h"

namespace ferrobench::server {
namespace {

namespace fs = std::filesystem;

struct ImportParams {
  std::string name{};
  recordings::CsvImport import{};
  std::optional<recordings::SourceKind> kind{};
};
template <class Visitor>
void describe(Visitor& visit, ImportParams& p) {
  visit("name", p.name,
        {.required = true, .doc = "of the new recording; of several, name-table-01 and so on"});
  describe(visit, p.import);
  visit("as", p.kind, {.doc = "kind of the text; absent: found"});
}

struct FoundRow {
  std::string recording{}, kind{}, message{};
};
template <class Visitor>
void describe(Visitor& visit, FoundRow& f) {
  visit("recording", f.recording, {.doc = "name"});
  visit("kind", f.kind, {.doc = "note, check, warning, flag (of the tester), pulse or gap"});
  visit("message", f.message, {});
}

struct ImportResult {
  RecordingRow first{};
  std::vector<RecordingRow> recordings{};
  std::vector<FoundRow> findings{};
};
template <class Visitor>
void describe(Visitor& visit, ImportResult& r) {
  describe(visit, r.first);
  visit("recordings", r.recordings, {.doc = "all that were made, one for each table; the first is this one"});
  visit("findings", r.findings,
        {.doc = "what was checked, taken for what, and found; the recordings have it"});
}

void demand_free(const fs::path& path) {
  if (Store::is_taken(path))
    throw Error(ErrorCode::busy, "a recording of this name is there already",
                Problem{.path = "/name", .given = path.stem().string(), .hint = "choose another name"});
}

ImportResult import(const Engine& engine, const ImportParams& p) {
  check_name(p.name, "/name");
  const auto place = [&](const std::string& name) { return engine.store().recordings() / (name + ".h5"); };
  demand_free(place(p.name));
  const auto imported = recordings::import_tables(p.import, p.kind);
  std::vector<std::string> paths;
  for (std::size_t i = 0; i < imported.size(); ++i) {
    paths.push_back(place(imported.size() == 1 ? p.name : p.name + recordings::table_suffix(i + 1)));
    demand_free(paths.back());
  }
  ImportResult out;
  for (std::size_t i = 0; i < imported.size(); ++i) {
    try {
      recordings::write_recording(paths[i], imported[i].recording, recordings::Existing::keep);
    } catch (const recordings::NameTaken&) {  // by another import, just now
      demand_free(paths[i]);
      throw;
    }
    for (const auto& f : imported[i].findings)
      out.findings.push_back({fs::path(paths[i]).stem().string(), f.kind, f.message});
  }
  out.recordings = rows_of(paths);
  out.first = out.recordings.front();
  return out;
}

}  // namespace

void add_import_method(Dispatcher& rpc, Engine& engine) {
  rpc.add<ImportParams>({.name = "recording.import",
                         .doc = "Makes a recording of each table that a tester or another program wrote.",
                         .role = Role::control,
                         .lane = Lane::heavy,
                         .errors = {ErrorCode::not_found, ErrorCode::busy, ErrorCode::bad_state,
                                    ErrorCode::bad_recording, ErrorCode::io_error, ErrorCode::disk_full}},
                        [&engine](const ImportParams& p) { return import(engine, p); });
}

}  // namespace ferrobench::server
