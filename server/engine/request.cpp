#include "server/engine/request.h"

#include <algorithm>

#include "base/load_range.h"
#include "base/units.h"
#include "daq/registry.h"
#include "model/model.h"

namespace ferrobench::server {

using nlohmann::json;

namespace {

// Enough to draw a program whose field never moves, and to see noise on it.
constexpr double usual_sample_rate = 50;

void add_leaves(const json& value, const std::string& path, std::vector<std::string>& out) {
  if (!value.is_object()) return out.push_back(path);
  for (const auto& [key, item] : value.items())
    add_leaves(item, std::string(path).append(".").append(key), out);
}

double number(const std::string& key, const json& value) {
  if (value.is_number()) return value.get<double>();
  throw Error(ErrorCode::invalid_params, "this setting is a number",
              Problem{.path = "/set/" + key,
                      .message = "is not a number",
                      .given = value,
                      .hint = "for example " + key + "=1"});
}

double number(const std::string& key, const json& value, const FieldInfo& info) {
  const double out = number(key, value);
  std::vector<Problem> problems;
  fields_detail::check_number(out, info, "/set/" + key, problems);
  if (!problems.empty())
    throw Error(ErrorCode::invalid_params, "a setting is outside its range", std::move(problems));
  return out;
}

// Sets what stands at "a.b.c" in `target`. False if there is no such place; `create` makes it.
bool set_path(json& target, std::string_view path, const json& value, bool create) {
  json* at = &target;
  while (!path.empty()) {
    const auto dot = std::min(path.find('.'), path.size());
    const auto key = std::string(path.substr(0, dot));
    if (!at->is_object() || (!create && !at->contains(key))) return false;
    at = &at->emplace(key, create && dot < path.size() ? json::object() : json()).first.value();
    path.remove_prefix(std::min(dot + 1, path.size()));
  }
  *at = value;
  return true;
}

FieldInfo prestress_in(std::string_view unit, double pascal) {
  return {.unit = unit, .min = prestress_min / pascal, .max = prestress_max / pascal};
}

struct Settings {
  std::map<std::string, double> parameters;
  std::optional<double> prestress, spring_stiffness, sample_rate;
};

class Reader {
 public:
  Reader(const protocols::Protocol& protocol, json& model, json& device, bool fresh)
      : known_(protocol.parameters()), model_(model), device_(device), fresh_(fresh) {}

  Settings read(const json& set) {
    if (!set.is_object())
      throw Error(ErrorCode::invalid_params, "settings are values by key",
                  Problem{.path = "/set", .message = "is not an object", .given = set});
    for (const auto& [key, value] : set.items())
      if (!take(key, value) && problems_.size() < max_problems) problems_.push_back(unknown(key, value));
    if (!problems_.empty())
      throw Error(ErrorCode::invalid_params, "a setting is not known", std::move(problems_));
    return std::move(settings_);
  }

 private:
  bool take(const std::string& key, const json& value) {
    if (known_.contains(key)) return settings_.parameters[key] = number(key, value), true;
    if (key == "sample_rate_Hz") return settings_.sample_rate = number(key, value), true;
    if (!fresh_) return false;
    if (key == "prestress_Pa") return settings_.prestress = number(key, value, prestress_in("Pa", 1)), true;
    if (key == "prestress_MPa") {
      settings_.prestress = number(key, value, prestress_in("MPa", pascal_in_mpa)) * pascal_in_mpa;
      return true;
    }
    if (key == "spring_stiffness_N_per_m") {
      settings_.spring_stiffness = number(key, value, {.unit = "N/m", .min = 0, .max = spring_stiffness_max});
      return true;
    }
    const std::string_view path(key);
    if (path.starts_with("model.")) return set_path(model_, path.substr(6), value, false);
    if (key == "device.past" && value.is_string())
      throw Error(ErrorCode::invalid_params, "a past is an object with a kind",
                  Problem{.path = "/set/device.past",
                          .message = "must be an object",
                          .given = excerpt(value.get<std::string>()),
                          .hint = R"(for example 'device.past={"kind": "poled_minus"}')"});
    // Optional parts of the device's configuration are absent until set; opening it checks their names.
    return path.starts_with("device.") && set_path(device_, path.substr(7), value, true);
  }

  Problem unknown(const std::string& key, const json& value) const {
    std::vector<std::string> allowed;
    for (const auto& [name, unused] : known_) allowed.push_back(name);
    allowed.emplace_back("sample_rate_Hz");
    if (fresh_) {
      allowed.insert(allowed.end(), {"prestress_Pa", "prestress_MPa", "spring_stiffness_N_per_m"});
      add_leaves(model_, "model", allowed);
      allowed.emplace_back("device.<path>");
    }
    const auto guess = nearest_name(key, allowed);
    return {.path = "/set/" + excerpt(key),
            .message = "is not a setting of this run",
            .given = value,
            .allowed = allowed,
            .hint = !guess.empty() ? "did you mean \"" + guess + "\"?"
                    : fresh_       ? ""
                                   : "a device that is open keeps its model and load"};
  }

  std::map<std::string, double> known_;
  json& model_;
  json& device_;
  bool fresh_;
  Settings settings_;
  std::vector<Problem> problems_;
};

// Where no model says it: of the open device, or of the one that the configuration describes.
std::optional<double> layer_thickness_of(const json& config, const daq::DeviceFacts* open) {
  if (open != nullptr) return open->specimen ? std::optional(open->specimen->layer_thickness) : std::nullopt;
  const auto at = json::json_pointer("/specimen/layer_thickness");
  if (config.contains(at) && config.at(at).is_number()) return config.at(at).get<double>();
  return std::nullopt;
}

}  // namespace

protocols::Protocol resolve_protocol(const json& given, const Store* store) {
  if (given.is_string()) {
    const auto name = given.get<std::string>();
    return store != nullptr ? store->protocol(name) : protocols::library_protocol(name);
  }
  return protocols::Protocol::from_json(given);
}

json resolve_model(const json& given, const Store& store) {
  if (given.is_null()) return store.model(default_model_name());
  if (given.is_string()) return store.model(given.get<std::string>());
  return model::to_json(model::model_from_json(given));
}

std::optional<std::string> replayed(const std::string& device) {
  constexpr std::string_view prefix = "replay:";
  if (!device.starts_with(prefix)) return std::nullopt;
  return device.substr(prefix.size());
}

namespace {

void demand_own_program(const RunRequest& request) {
  if (request.protocol.is_null() && request.model.is_null()) return;
  throw Error(ErrorCode::invalid_params, "a replay has a program and a model of its own",
              Problem{.path = request.protocol.is_null() ? "/model" : "/protocol",
                      .message = "cannot be chosen for a replay",
                      .hint = "leave it out; model.simulate plays a recording's program through a model"});
}

}  // namespace

RunPlan make_replay_plan(const RunRequest& request, const std::string& file) {
  demand_own_program(request);
  if (!request.set.is_object())
    throw Error(ErrorCode::invalid_params, "settings are values by key",
                Problem{.path = "/set", .message = "is not an object", .given = request.set});
  RunPlan plan;
  plan.device_config = json::object();
  for (const auto& [key, value] : request.set.items()) {
    const std::string_view path(key);
    if (!path.starts_with("device.") || path == "device.file" ||
        !set_path(plan.device_config, path.substr(7), value, true))
      throw Error(ErrorCode::invalid_params, "a setting is not known",
                  Problem{.path = "/set/" + excerpt(key),
                          .message = "is not a setting of a replay",
                          .given = value,
                          .allowed = "device.<path>",
                          .hint = "for example device.displacement.gain=1.02"});
  }
  plan.device_config["file"] = file;
  if (request.fast) plan.device_config["clock"] = "fast";
  return plan;
}

RunPlan make_replay_plan(const RunRequest& request, const daq::ReplaySource& source) {
  demand_own_program(request);
  if (request.fast || !request.set.empty())
    throw Error(ErrorCode::invalid_params, "the device is open already and keeps its clock and calibration",
                Problem{.path = request.fast ? "/fast" : "/set",
                        .message = "cannot be chosen for an open device",
                        .hint = "name the recording instead: \"replay:NAME\""});
  RunPlan plan;
  complete_replay_plan(plan, source);
  return plan;
}

void complete_replay_plan(RunPlan& plan, const daq::ReplaySource& source) {
  const auto& header = source.recording().header;
  const auto& protocol = header.protocol;
  plan.name = protocol.is_object() && protocol.contains("name") && protocol["name"].is_string()
                  ? protocol["name"].get<std::string>()
                  : "replay";
  plan.title = header.title;
  plan.sample_rate = source.rate();
}

RunPlan make_plan(const RunRequest& request, const Store& store, const daq::DeviceFacts* open) {
  if (request.protocol.is_null())
    throw Error(
        ErrorCode::invalid_params, "there is no program to run",
        Problem{.path = "/protocol", .message = "is missing", .hint = "protocol.list names those that ship"});
  RunPlan plan{.protocol = resolve_protocol(request.protocol, &store)};
  const bool fresh = open == nullptr;
  if (!fresh && (!request.model.is_null() || request.fast))
    throw Error(ErrorCode::invalid_params, "the device is open already and keeps its model and clock",
                Problem{.path = request.model.is_null() ? "/fast" : "/model",
                        .message = "cannot be chosen for an open device",
                        .hint = "name the kind of device instead, and it is opened for this run"});
  if (!fresh && !request.config.is_null())
    throw Error(ErrorCode::invalid_params, "the device is open already and keeps its configuration",
                Problem{.path = "/config", .hint = "close it, and open it with the new configuration"});
  const bool modelled = fresh && request.device == "virtual";
  if (fresh && !modelled && (!request.model.is_null() || request.fast)) {
    daq::device_kind(request.device);  // a name that is misspelt is told as such
    throw Error(ErrorCode::invalid_params, "only the virtual device has a model and a fast clock",
                Problem{.path = request.model.is_null() ? "/fast" : "/model",
                        .given = request.device,
                        .hint = "leave it out; the specimen stands in the device's configuration"});
  }
  if (modelled) plan.model = resolve_model(request.model, store);
  if (!fresh) plan.model = open->model;
  json device = request.config.is_null() ? json::object() : request.config;
  if (!device.is_object())
    throw Error(ErrorCode::invalid_params, "a device's configuration is an object",
                Problem{.path = "/config", .given = excerpt(device.dump())});
  const auto settings = Reader(plan.protocol, plan.model, device, fresh).read(request.set);

  if (fresh && !modelled) {
    const auto load = plan.protocol.load();
    if (const auto p = settings.prestress ? settings.prestress : load.prestress)
      set_path(device, "load.prestress", *p, true);
    if (const auto k = settings.spring_stiffness ? settings.spring_stiffness : load.spring_stiffness)
      set_path(device, "load.spring_stiffness", *k, true);
    plan.device_config = std::move(device);
  } else if (modelled) {
    const auto load = plan.protocol.load();
    auto& in_force = plan.model["load"];
    if (const auto p = settings.prestress ? settings.prestress : load.prestress) in_force["prestress"] = *p;
    if (const auto k = settings.spring_stiffness ? settings.spring_stiffness : load.spring_stiffness)
      in_force["spring_stiffness"] = *k;
    plan.model = model::to_json(model::model_from_json(plan.model));
    device["model"] = plan.model;
    if (const auto past = plan.protocol.past(); past && past->known() && !device.contains("past"))
      device["past"] = to_json(*past);
    device["seed"] = request.seed;
    device["clock"] = request.fast ? "fast" : "real";
    plan.device_config = std::move(device);
  }

  protocols::ExpandOptions options{.parameters = settings.parameters};
  // Volts act on the layers of the specimen that is there, whichever one the program was written for.
  if (plan.protocol.json().value("unit", "") == "V")
    options.layer_thickness = plan.model.is_null()
                                  ? layer_thickness_of(plan.device_config, open).value_or(0)
                                  : plan.model.at("actuator").at("layer_thickness").get<double>();
  plan.protocol = plan.protocol.with(options);
  plan.name = plan.protocol.name();
  plan.title = plan.protocol.title();
  plan.sample_rate = settings.sample_rate.value_or(plan.protocol.sample_rate().value_or(usual_sample_rate));
  return plan;
}

}  // namespace ferrobench::server
