#include "model/inference/report/discovery_report.h"
#include "model/inference/study/discover.h"
#include "recordings/file/reader.h"
#include "recordings/tables/published.h"
#include "server/engine/simulation.h"
#include "server/methods/methods.h"
#include "server/methods/read_all.h"
#include "server/rpc/schemas.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;

struct DiscoveryParams {
  std::vector<std::string> recordings{}, tables{}, held_out{};
  json model{};
  std::string name{};
  std::int64_t seed = 1, threads = 0;
  double floor = model::DiscoverOptions{}.floor;
};
template <class Visitor>
void describe(Visitor& visit, DiscoveryParams& p) {
  static const auto names = recordings::published_table_names();
  static const auto tables =
      "in place of recordings: published tables, " + names.front() + " to " + names.back();
  visit("recordings", p.recordings, {.doc = "names of the recordings of the bench"});
  visit("tables", p.tables, {.doc = tables});
  visit("model", p.model, {.doc = "name or model in question; absent: the default one"});
  visit("held_out", p.held_out, {.doc = "names of those to lock away for the proof; absent: chosen"});
  visit("name", p.name, {.doc = "keeps the improved model under this name"});
  visit("seed", p.seed, {.min = 0, .doc = "of the recalibration's other starts"});
  visit("threads", p.threads, {.min = 0, .max = 256, .doc = "0: as many as the machine has"});
  visit("floor", p.floor,
        {.min = 0,
         .max = 1,
         .exclusive_min = true,
         .doc = "what is left counts as material above this share of a channel's range"});
}
struct DiscoveryJob {
  std::string job{};
};
template <class Visitor>
void describe(Visitor& visit, DiscoveryJob& p) {
  visit("job", p.job, {.required = true, .doc = "as discrepancy.start gave it"});
}
enum class DiscoveryFormat { as_json, as_html, as_text };
std::span<const std::pair<DiscoveryFormat, std::string_view>> enum_names(DiscoveryFormat) {
  static constexpr std::array<std::pair<DiscoveryFormat, std::string_view>, 3> names{
      {{DiscoveryFormat::as_json, "json"},
       {DiscoveryFormat::as_html, "html"},
       {DiscoveryFormat::as_text, "text"}}};
  return names;
}
struct DiscoveryResult {
  std::string job{};
  DiscoveryFormat format = DiscoveryFormat::as_json;
};
template <class Visitor>
void describe(Visitor& visit, DiscoveryResult& p) {
  visit("job", p.job, {.required = true, .doc = "as discrepancy.start gave it"});
  visit("format", p.format, {.doc = "json: all of it; html: the report; text: the report for a terminal"});
}

json search_discrepancy(Engine& engine, const DiscoveryParams& p, Jobs::Handle& job) {
  job.say(0, "reading");
  const auto base = model::model_from_json(resolve_model(p.model, engine.store()));
  std::vector<model::NamedRecording> recordings;
  for (auto& recording : read_all(engine, p.recordings, &job))
    recordings.push_back({p.recordings[recordings.size()], std::move(recording)});
  model::DiscoverOptions options;
  options.held_out = p.held_out;
  options.seed = static_cast<std::uint64_t>(p.seed);
  options.threads = static_cast<int>(p.threads);
  options.floor = p.floor;
  options.progress = [&job](const model::DiscoverProgress& progress) {
    job.say(progress.fraction, progress.stage);
    return !job.cancelled();
  };
  options.stop = [&job] { return job.cancelled(); };
  const auto found = p.tables.empty() ? model::discover(base, std::move(recordings), options)
                                      : model::discover_in_tables(base, p.tables, options);
  job.check();
  if (!p.name.empty()) engine.store().put_model(p.name, to_json(found.improved));
  return {{"discovery", to_json(found)}, {"html", html_report(found)}, {"text", text_report(found)}};
}

// Of to_json(Discovery), or the report's text.
json discovery_schema() {
  using namespace schema;
  const auto rows = list_of(any_object());
  auto out = object(
      {{"verdict", text()},
       {"explanations", rows},
       {"probability_unknown", number()},
       {"probability_nothing", number()},
       {"family", or_null(text("kind of an unknown effect"))},
       {"where",
        list_of(
            object({{"recording", text()}, {"channel", text()}, {"segment", any()}, {"excess", number()}}))},
       {"recalibrated",
        map_of(object({{"from", number()},
                       {"to", number()},
                       {"std", number()},
                       {"over_prior", number("", "in standard deviations of what was known of it")}}))},
       {"gap", any_object("residual over noise, before and after")},
       {"left",
        map_of(object({{"over_noise", number()}, {"of_range", number()}, {"model_error", number()}}))},
       {"share", number("", "of the excess over noise that the explanation removes; 0 to 1")},
       {"share_held_out", number("", "likewise, on recordings that were locked away")},
       {"remainder", or_null(any_object("what is left, where it is material: family, channel, segment, "
                                        "of_range"))},
       {"added",
        list_of(any_object("a term of the improved model: id, empirical, parameters, intervals, share, "
                           "share_held_out; share_of: the channel whose excess is meant, or null"))},
       {"pasts", list_of(any_object("of a recording, and whether it was chosen"))},
       {"model", any_object("the improved one")},
       {"asked", any_object("what was asked and of what: model, sources, options, time, software")},
       {"findings", list_of(text(), "in sentences")}},
      any());
  out["type"] = {"object", "string"};
  return out;
}

JobStatus discovery_status(Engine& engine, const std::string& id) {
  auto status = engine.jobs().status(id);
  if (status.kind != "discover")
    throw Error(ErrorCode::not_found, "the job is no search for a discrepancy",
                Problem{.path = "/job", .message = "is a job of another kind", .given = id});
  return status;
}

}  // namespace

void add_discrepancy_methods(Dispatcher& rpc, Engine& engine) {
  rpc.add<DiscoveryParams>(
      {.name = "discrepancy.start",
       .doc =
           "Finds what a model misses in recordings, names it, adds it, and proves it on unseen ones. A job; "
           "job.cancel stops it.",
       .role = Role::control,
       .errors = {ErrorCode::not_found, ErrorCode::busy}},
      [&engine](const DiscoveryParams& p) {
        if (!p.name.empty()) check_name(p.name, "/name");
        if (p.recordings.empty() == p.tables.empty())
          throw Error(ErrorCode::invalid_params, "recordings or tables are wanted, not both");
        for (const auto& name : p.recordings) engine.store().recording(name);
        for (const auto& name : p.tables) recordings::published_table(name);
        const auto id = engine.jobs().start(
            "discover", [&engine, p](Jobs::Handle& job) { return search_discrepancy(engine, p, job); });
        return engine.jobs().status(id);
      });
  rpc.add<DiscoveryJob>({.name = "discrepancy.status",
                         .doc = "How far a search is: stage, progress, time left.",
                         .errors = {ErrorCode::not_found}},
                        [&engine](const DiscoveryJob& p) {
                          auto status = discovery_status(engine, p.job);
                          status.result = nullptr;
                          return status;
                        });
  rpc.add<DiscoveryResult>(
      {.name = "discrepancy.result",
       .doc = "What a search found: verdict, explanations, where, gap, improved model; or its report.",
       .lane = Lane::heavy,
       .errors = {ErrorCode::not_found, ErrorCode::bad_state},
       .result_schema = discovery_schema()},
      [&engine](const DiscoveryResult& p) -> json {
        const auto status = discovery_status(engine, p.job);
        if (status.state != JobState::complete)
          throw Error(
              ErrorCode::bad_state, "there is no result yet",
              Problem{.path = "/job", .message = "is not complete", .given = p.job, .hint = status.stage});
        switch (p.format) {
          case DiscoveryFormat::as_html:
            return status.result.at("html");
          case DiscoveryFormat::as_text:
            return status.result.at("text");
          case DiscoveryFormat::as_json:
            break;
        }
        return status.result.at("discovery");
      });
}

}  // namespace ferrobench::server
