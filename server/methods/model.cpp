#include "model/model.h"

#include "recordings/file/reader.h"
#include "server/engine/fitting.h"
#include "server/engine/simulation.h"
#include "server/methods/methods.h"
#include "server/methods/read_all.h"
#include "server/rpc/schemas.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;

struct ModelRow {
  std::string name{}, title{}, notes{}, error{};
};
template <class Visitor>
void describe(Visitor& visit, ModelRow& r) {
  visit("name", r.name, {.required = true});
  visit("title", r.title, {});
  visit("notes", r.notes, {.doc = "how it was obtained"});
  visit("error", r.error, {.doc = "why it cannot be used; \"\" if it can"});
}
struct ModelList {
  std::vector<ModelRow> models{};
  std::string usual{};
};
template <class Visitor>
void describe(Visitor& visit, ModelList& l) {
  visit("models", l.models, {.required = true});
  visit("default", l.usual, {.doc = "used where a run names none"});
}
struct ModelName {
  std::string name{};
};
template <class Visitor>
void describe(Visitor& visit, ModelName& p) {
  visit("name", p.name, {.required = true, .doc = "of a model, as model.list gives it"});
}
struct ModelText {
  json model{};
};
template <class Visitor>
void describe(Visitor& visit, ModelText& m) {
  visit("model", m.model, {.required = true, .doc = "as JSON; model.schema describes it"});
}
struct PutParams {
  std::string name{};
  json model{};
};
template <class Visitor>
void describe(Visitor& visit, PutParams& p) {
  visit("name", p.name, {.required = true, .doc = "to keep it under"});
  visit("model", p.model, {.required = true, .doc = "as JSON; model.schema describes it"});
}
struct SimulateParams {
  std::string recording{};
  json model{};
  std::optional<protocols::Past> past{};
};
template <class Visitor>
void describe(Visitor& visit, SimulateParams& p) {
  visit("recording", p.recording, {.required = true, .doc = "name of a recording"});
  visit("model", p.model, {.doc = "name or model; absent: the recording's own"});
  visit(
      "past", p.past,
      {.doc = "what the specimen has been through before; absent: what the recording says or, where it does "
              "not, poled towards +"});
}

// One that cannot be read keeps none of the others from the list.
ModelRow row_of_model(const Store& store, const std::string& name) {
  try {
    const auto model = store.model(name);
    return {.name = name, .title = model.value("name", name), .notes = model.value("notes", "")};
  } catch (const Error& error) {
    return {.name = name, .title = name, .error = error.what()};
  }
}

json simulate(Engine& engine, const SimulateParams& p, Jobs::Handle& job) {
  job.say(0, "reading");
  const auto source = recordings::read_recording(engine.store().recording(p.recording).string());
  const auto model = p.model.is_null() ? json() : resolve_model(p.model, engine.store());
  job.check();
  job.say(0.1, "simulating");
  const auto simulation =
      simulate_recording(source, model, p.recording, p.past, [&job] { return job.cancelled(); });
  job.check();
  job.say(0.9, "writing");
  const auto path = engine.store().add_recording(p.recording + "-simulated", simulation.recording);
  return {{"recording", path.stem().string()},
          {"path", path.string()},
          {"time_error", simulation.time_error},
          {"quadrature_error", simulation.quadrature_error}};
}

struct FitParams {
  FitRequest request;
  std::vector<std::string> recordings{};
  json model{};
  std::string name{};
};
template <class Visitor>
void describe(Visitor& visit, FitParams& p) {
  visit("recordings", p.recordings, {.doc = "names of the recordings to come near to"});
  visit("model", p.model, {.doc = "name or model to start from; absent: the default one"});
  visit("name", p.name, {.doc = "keeps the fitted model under this name"});
  describe(visit, p.request);
}

json fit(Engine& engine, const FitParams& p, Jobs::Handle& job) {
  job.say(0, "reading");
  const auto start = model::model_from_json(resolve_model(p.model, engine.store()));
  auto result = fit_model(
      p.request, start, read_all(engine, p.recordings, &job),
      [&job](const model::FitProgress& progress) {
        job.say(progress.fraction, progress.stage);
        return !job.cancelled();
      },
      [&job] { return job.cancelled(); });
  if (result.value("stopped", false))
    job.stopped();
  else if (!p.name.empty())
    engine.store().put_model(p.name, result.at("model"));
  return result;
}

}  // namespace

void add_model_methods(Dispatcher& rpc, Engine& engine) {
  rpc.add<NoParams>({.name = "model.list",
                     .doc = "The shipped models and those put here.",
                     .lane = Lane::heavy,
                     .errors = {ErrorCode::bad_model, ErrorCode::io_error}},
                    [&engine](const NoParams&) {
                      ModelList out{.models = {}, .usual = default_model_name()};
                      for (const auto& name : engine.store().model_names())
                        out.models.push_back(row_of_model(engine.store(), name));
                      return out;
                    });
  rpc.add<ModelName>({.name = "model.get",
                      .doc = "A model by name.",
                      .errors = {ErrorCode::not_found, ErrorCode::bad_model, ErrorCode::io_error}},
                     [&engine](const ModelName& p) { return ModelText{engine.store().model(p.name)}; });
  rpc.add<NoParams>({.name = "model.schema",
                     .doc = "JSON Schema of a model.",
                     .result_schema = schema::json_schema_document()},
                    [](const NoParams&) { return model::model_schema(); });
  rpc.add<PutParams>({.name = "model.put",
                      .doc = "Keeps a model under a name.",
                      .role = Role::control,
                      .errors = {ErrorCode::bad_model, ErrorCode::io_error, ErrorCode::disk_full}},
                     [&engine](const PutParams& p) { engine.store().put_model(p.name, p.model); });
  rpc.add<SimulateParams>(
      {.name = "model.simulate",
       .doc = "Plays a recording's own program through a model, without noise, into a new recording. A job.",
       .role = Role::control,
       .lane = Lane::heavy,
       .errors = {ErrorCode::not_found, ErrorCode::busy}},
      [&engine](const SimulateParams& p) {
        if (p.past) demand_sound(*p.past);
        engine.store().recording(p.recording);
        const auto id = engine.jobs().start(
            "simulate", [&engine, p](Jobs::Handle& job) { return simulate(engine, p, job); });
        return engine.jobs().status(id);
      });
  rpc.add<FitParams>(
      {.name = "model.fit",
       .doc = "Fits a model to published tables or to recordings, or calibrates it. A job; cancelled, its "
              "result is the best so far, which is kept under no name.",
       .role = Role::control,
       .errors = {ErrorCode::not_found, ErrorCode::busy}},
      [&engine](const FitParams& p) {
        if (!p.name.empty()) check_name(p.name, "/name");
        const auto id =
            engine.jobs().start("fit", [&engine, p](Jobs::Handle& job) { return fit(engine, p, job); });
        return engine.jobs().status(id);
      });
}

}  // namespace ferrobench::server
