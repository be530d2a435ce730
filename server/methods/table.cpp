#include "recordings/reports/table.h"

#include "recordings/tables/comparison.h"
#include "server/engine/table_runs.h"
#include "server/methods/methods.h"
#include "server/methods/read_all.h"
#include "server/methods/recording_rows.h"
#include "server/rpc/schemas.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;

struct TableParams {
  std::string table{}, format = "json";
  json model{}, set = json::object();
  std::int64_t seed = 1;
};
template <class Visitor>
void describe(Visitor& visit, TableParams& p) {
  static const auto tables = "of the source: " + recordings::published_tables_in_words();
  visit("table", p.table, {.required = true, .doc = tables});
  visit("model", p.model, {.doc = "name or model; absent: the shipped set of the table's specimen"});
  visit("set", p.set, {.doc = "as for run.start, for every run of the table"});
  visit("seed", p.seed, {.min = 0, .doc = "of the noise"});
  visit("format", p.format,
        {.doc =
             "of the job's result: json gives the comparison itself; text, md, csv and html give {content}"});
}

json run_job(const Store& store, const TableParams& p, const std::vector<RunRequest>& requests,
             Jobs::Handle& job) {
  const auto format = recordings::format_from_name(p.format);
  const auto comparison = run_table(p.table, requests, store, "", [&job](double share) {
    job.say(share, "running");
    return !job.cancelled();
  });
  return format == recordings::Format::json ? to_json(comparison)
                                            : json{{"content", render(comparison, format)}};
}

struct TableRow {
  std::string name{}, title{};
};
template <class Visitor>
void describe(Visitor& visit, TableRow& r) {
  visit("name", r.name, {.required = true, .doc = "for table.run and table.compare"});
  visit("title", r.title, {.required = true});
}
struct TableList {
  std::vector<TableRow> tables{};
};
template <class Visitor>
void describe(Visitor& visit, TableList& l) {
  visit("tables", l.tables, {.required = true, .doc = "by name"});
}

struct CompareParams {
  std::string table{};
  std::vector<std::string> recordings{};
};
template <class Visitor>
void describe(Visitor& visit, CompareParams& p) {
  static const auto tables = "of the source: " + recordings::published_tables_in_words();
  visit("table", p.table, {.required = true, .doc = tables});
  visit("recordings", p.recordings, {.required = true, .doc = "names of recordings"});
}

json compare(Engine& engine, const CompareParams& p) {
  const auto table = recordings::published_table(p.table);
  return to_json(as_table(recordings::compare(table, read_all(engine, p.recordings))));
}

}  // namespace

void add_table_methods(Dispatcher& rpc, Engine& engine) {
  rpc.add<NoParams>({.name = "table.list", .doc = "The published tables of the source."},
                    [](const NoParams&) {
                      TableList out;
                      for (const auto& name : recordings::published_table_names())
                        out.tables.push_back({name, recordings::published_table(name).title});
                      return out;
                    });
  rpc.add<TableParams>(
      {.name = "table.run",
       .doc = "Runs a published table's experiments on virtual devices of their own, beside the "
              "bench, and compares. A job; no recording is kept.",
       .role = Role::control,
       .errors = {ErrorCode::not_found, ErrorCode::busy}},
      [&engine](const TableParams& p) {
        recordings::format_from_name(p.format);
        auto requests = table_requests(p.table, p.model, p.set, p.seed);
        const auto id =
            engine.jobs().start("table", [&engine, p, requests = std::move(requests)](Jobs::Handle& job) {
              return run_job(engine.store(), p, requests, job);
            });
        return engine.jobs().status(id);
      });
  rpc.add<CompareParams>({.name = "table.compare",
                          .doc = "The cells of a published table as recordings of this bench have them.",
                          .lane = Lane::heavy,
                          .errors = {ErrorCode::not_found, ErrorCode::bad_recording,
                                     ErrorCode::limit_exceeded, ErrorCode::io_error, ErrorCode::cancelled},
                          .result_schema = table_schema()},
                         [&engine](const CompareParams& p) { return compare(engine, p); });
}

}  // namespace ferrobench::server
