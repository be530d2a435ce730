#include "server/engine/fitting.h"

#include "model/inference/report/fit_page.h"
#include "model/inference/study/calibrate.h"

namespace ferrobench::server {

using nlohmann::json;

namespace {

using Summary = std::vector<std::pair<std::string, double>>;

json to_json(const Summary& summary) {
  json out = json::object();
  for (const auto& [name, value] : summary) out[name] = value;
  return out;
}

json calibrated(const model::Model& start, const std::vector<recordings::Recording>& loops) {
  if (loops.empty() || loops.size() > 2)
    throw Error(ErrorCode::invalid_params, "a calibration takes one recording, or two at different prestress",
                Problem{.path = "/recordings", .given = loops.size(), .allowed = "1 or 2"});
  return {{"model", model::to_json(model::calibrate_parametrized(start, loops[0],
                                                                 loops.size() > 1 ? &loops[1] : nullptr))}};
}

std::map<std::string, double> numbers_of(const json& set) {
  std::map<std::string, double> out;
  for (const auto& [key, value] : set.items()) {
    if (!value.is_number())
      throw Error(ErrorCode::invalid_params, "a setting of a fit is a number",
                  Problem{.path = "/set/" + key, .message = "is not a number", .given = value});
    out[key] = value.get<double>();
  }
  return out;
}

std::unique_ptr<model::ResidualModel> residuals_of(const FitRequest& request,
                                                   std::vector<recordings::Recording> recordings) {
  if (request.tables.empty() == recordings.empty())
    throw Error(ErrorCode::invalid_params, "a fit comes near to tables or to recordings",
                Problem{.path = "/tables",
                        .message = recordings.empty() ? "is missing, and so are recordings"
                                                      : "cannot be fitted together with recordings",
                        .hint = "for example the table 3.13, or a recording"});
  return recordings.empty() ? model::table_residuals(request.tables, numbers_of(request.set))
                            : model::recording_residuals(std::move(recordings));
}

}  // namespace

json fit_model(const FitRequest& request, const model::Model& start,
               std::vector<recordings::Recording> recordings,
               const std::function<bool(const model::FitProgress&)>& progress,
               const std::function<bool()>& stop) {
  if (request.calibrate) return calibrated(start, recordings);
  std::vector<model::NoiseByChannel> noise;
  noise.reserve(recordings.size());
  for (const auto& r : recordings) noise.push_back(model::noise_of(r));
  const auto residuals = residuals_of(request, std::move(recordings));
  model::FitOptions options;
  options.starts = static_cast<int>(request.starts);
  options.iterations = static_cast<int>(request.iterations);
  options.seed = static_cast<std::uint64_t>(request.seed);
  options.progress = progress;
  // Tables are run on the virtual device, so what is fitted to them is what `table` will show.
  if (!request.tables.empty()) options.simulation = model::below_noise;
  if (stop) options.simulation.stop = &stop;
  const auto evidence = model::evidence_of(residuals->recordings());
  for (const auto& path : request.free) options.free.push_back(model::free_parameter(start, path, evidence));
  if (options.free.empty()) options.free = model::default_free_parameters(start, evidence);

  const auto result = model::fit(start, *residuals, options);
  const auto& compared = result.residuals ? *result.residuals : *residuals;
  // What was stopped is not simulated again to say how well it did.
  const auto summary = [&](const model::Model& m) {
    return result.stopped ? Summary{} : compared.summary(m, {.simulation = options.simulation});
  };
  const auto before = summary(start), after = summary(result.model);
  json parameters = json::array();
  for (const auto& p : result.parameters) {
    parameters.push_back({{"path", p.free.path},
                          {"from", p.from},
                          {"to", p.to},
                          {"std", p.std},
                          {"low", p.free.low},
                          {"high", p.free.high},
                          {"at_bound", p.at_bound}});
    if (!result.stopped)
      parameters.back().update({{"interval", {p.low, p.high}}, {"determined", p.determined}});
  }
  json pasts = json::array();
  for (const auto& p : result.pasts) {
    pasts.push_back(protocols::to_json(p.past));
    pasts.back().update({{"recording", p.recording}, {"chosen", p.chosen}});
  }
  json out = {{"model", model::to_json(result.model)},
              {"parameters", std::move(parameters)},
              {"before", to_json(before)},
              {"after", to_json(after)},
              {"cost_before", result.cost_before},
              {"cost_after", result.cost_after},
              {"simulations", result.simulations},
              {"stopped", result.stopped},
              {"pasts", std::move(pasts)},
              {"unused", residuals->unused()}};
  std::optional<model::FitVerdict> verdict;
  if (!result.stopped) {
    out["correlations"] = result.correlations;
    verdict = model::judge(result, compared, after, noise);
    out["verdict"] = {{"text", verdict->text()},
                      {"times_noise", verdict->times_noise ? json(*verdict->times_noise) : json()},
                      {"where", verdict->where},
                      {"at_bound", verdict->at_bound},
                      {"parameters", verdict->parameters},
                      {"intervals_hold", verdict->intervals_hold()}};
  }
  if (request.report)
    out["html"] = model::html_report({result, options, compared, start, before, after, verdict});
  return out;
}

}  // namespace ferrobench::server
