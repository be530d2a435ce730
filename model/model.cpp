#include "model/model.h"

#include <algorithm>
#include <array>

#include "base/text_file.h"
#include "model/effects/catalogue.h"
#include "model/model_fields.h"

namespace ferrobench::model {

// Made by the build from model/library/*.json.
std::optional<std::string_view> embedded(std::string_view name);
std::vector<std::string_view> embedded_names();

namespace {

constexpr std::array<std::pair<BarrierLaw, std::string_view>, 2> barrier_laws{
    {{BarrierLaw::equal_curvature, "equal_curvature"}, {BarrierLaw::unequal_curvature, "unequal_curvature"}}};
constexpr std::array<std::pair<PolycrystalMethod, std::string_view>, 3> methods{
    {{PolycrystalMethod::none, "none"},
     {PolycrystalMethod::distribution, "distribution"},
     {PolycrystalMethod::parametrized, "parametrized"}}};

// The file's own shape of an effect: its parameters are an object.
struct EffectJson {
  std::string id;
  nlohmann::json parameters = nlohmann::json::object();
};
struct FileShape {
  std::string format;
  std::int64_t version = 1;
  Model model;
  std::vector<EffectJson> effects;
};

}  // namespace

std::span<const std::pair<BarrierLaw, std::string_view>> enum_names(BarrierLaw) {
  return barrier_laws;
}
std::span<const std::pair<PolycrystalMethod, std::string_view>> enum_names(PolycrystalMethod) {
  return methods;
}

namespace {

template <class Visitor>
void describe(Visitor& visit, EffectJson& e) {
  visit("id", e.id, {.required = true});
  visit("parameters", e.parameters, {.required = true});
}

template <class Visitor>
void describe(Visitor& visit, FileShape& f) {
  visit("format", f.format, {.required = true, .doc = "ferrobench-model"});
  visit("version", f.version, {.min = 1, .max = 1, .required = true});
  visit("name", f.model.name, {});
  visit("notes", f.model.notes, {});
  visit("material", f.model.material, {.required = true});
  visit("polycrystal", f.model.polycrystal, {.required = true});
  visit("actuator", f.model.actuator, {.required = true});
  visit("load", f.model.load, {.required = true});
  visit("effects", f.effects, {});
}

void read_effects(FileShape& file, std::vector<Problem>& problems) {
  for (std::size_t i = 0; i < file.effects.size(); ++i) {
    const auto& given = file.effects[i];
    const auto path = "/effects/" + std::to_string(i) + "/parameters";
    EffectSetting setting{.id = given.id, .parameters = {}};
    if (!given.parameters.is_object()) {
      problems.push_back({.path = path, .message = "must be an object"});
      continue;
    }
    for (const auto& [name, value] : given.parameters.items()) {
      if (value.is_number())
        setting.parameters.emplace_back(name, value.get<double>());
      else
        problems.push_back(
            {.path = fields_detail::pointer(path, name), .message = "must be a number", .given = value});
    }
    file.model.effects.push_back(std::move(setting));
  }
}

void check_branch(const std::vector<CriticalForcePoint>& branch, const std::string& path,
                  std::vector<Problem>& problems) {
  if (branch.size() < 2) problems.push_back({.path = path, .message = "needs at least two points"});
  for (std::size_t i = 1; i < branch.size(); ++i)
    if (branch[i].fraction <= branch[i - 1].fraction)
      problems.push_back({.path = path + "/" + std::to_string(i) + "/fraction",
                          .message = "must rise from point to point",
                          .given = branch[i].fraction});
}

void check_gap(const CriticalForce& c, std::vector<Problem>& problems) {
  const auto check = [&](const std::vector<CriticalForcePoint>& branch, const std::string& path) {
    for (std::size_t i = 0; i < branch.size(); ++i) {
      const double x = branch[i].fraction, unload = force_at(c.unload, x);
      if (force_at(c.load, x) >= unload)
        problems.push_back({.path = path + "/" + std::to_string(i) + "/force",
                            .message = "load must lie below unload; here it is",
                            .given = force_at(c.load, x),
                            .allowed = unload,
                            .unit = "J/m^3"});
    }
  };
  check(c.unload, "/polycrystal/critical_force/unload");
  check(c.load, "/polycrystal/critical_force/load");
}

void check_polycrystal(const Polycrystal& p, std::vector<Problem>& problems) {
  if (p.method == PolycrystalMethod::parametrized && !p.critical_force)
    problems.push_back(
        {.path = "/polycrystal/critical_force",
         .message = "is missing",
         .hint = "the method \"parametrized\" is calibrated from a slow loop: model.fit with calibrate"});
  if (!p.critical_force) return;
  check_branch(p.critical_force->unload, "/polycrystal/critical_force/unload", problems);
  check_branch(p.critical_force->load, "/polycrystal/critical_force/load", problems);
  if (problems.empty()) check_gap(*p.critical_force, problems);
}

}  // namespace

double force_at(std::span<const CriticalForcePoint> branch, double fraction) {
  const auto above = std::upper_bound(branch.begin(), branch.end(), fraction,
                                      [](double f, const CriticalForcePoint& p) { return f < p.fraction; });
  if (above == branch.begin()) return branch.front().force;
  if (above == branch.end()) return branch.back().force;
  const auto below = above - 1;
  const double u = (fraction - below->fraction) / (above->fraction - below->fraction);
  return below->force + u * (above->force - below->force);
}

Model model_from_json(const nlohmann::json& json) {
  FileShape file;
  std::vector<Problem> problems;
  read_json(json, file, "", problems);
  if (problems.empty() && file.format != "ferrobench-model")
    problems.push_back({.path = "/format",
                        .message = "is not that of a model file",
                        .given = file.format,
                        .allowed = "ferrobench-model"});
  if (problems.empty()) {
    read_effects(file, problems);
    if (problems.empty()) problems = check_effects(file.model.effects, "/effects");
    check_polycrystal(file.model.polycrystal, problems);
  }
  if (!problems.empty()) throw Error(ErrorCode::bad_model, "the model is not valid", std::move(problems));
  return std::move(file.model);
}

Model model_from_text(std::string_view text) {
  return model_from_json(parse_json_text(text, ErrorCode::bad_model, "the model"));
}

Model model_from_file(const std::string& path) {
  return model_from_text(read_text_file(path, 16u << 20, ErrorCode::bad_model, Pipes::read));
}

nlohmann::json to_json(const Model& model) {
  FileShape file{.format = "ferrobench-model", .version = 1, .model = model, .effects = {}};
  for (const auto& effect : model.effects) {
    EffectJson out{.id = effect.id};
    for (const auto& [name, value] : effect.parameters) out.parameters[name] = value;
    file.effects.push_back(std::move(out));
  }
  auto json = write_json(file);
  if (!model.actuator.passive_stiffness) json["actuator"]["passive_stiffness"] = nullptr;
  return json;
}

nlohmann::json model_schema() {
  auto schema = json_schema<FileShape>();
  schema["$schema"] = "https://json-schema.org/draft/2020-12/schema";
  schema["$id"] = "urn:ferrobench:model:1";
  schema["title"] = "ferrobench model";
  return schema;
}

std::vector<std::string> model_library_names() {
  std::vector<std::string> names;
  for (auto name : embedded_names()) {
    name = name.substr(name.rfind('/') + 1);
    names.emplace_back(name.substr(0, name.rfind('.')));
  }
  return names;
}

Model library_model(std::string_view name) {
  if (const auto text = embedded("library/" + std::string(name) + ".json")) return model_from_text(*text);
  const auto names = model_library_names();
  const auto guess = nearest_name(name, names);
  throw Error(ErrorCode::not_found, "there is no model of that name",
              Problem{.path = "",
                      .message = "is neither shipped nor a file",
                      .given = name,
                      .allowed = names,
                      .hint = guess.empty() ? "" : "did you mean \"" + guess + "\"?"});
}

}  // namespace ferrobench::model
