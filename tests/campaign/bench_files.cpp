#include <fmt/format.h>

#include <filesystem>
#include <fstream>

#include "recordings/file/reader.h"
#include "recordings/file/writer.h"
#include "tests/campaign/bench.h"

namespace ferrobench::campaign {
namespace {

void write_text(const std::filesystem::path& path, const nlohmann::json& json) {
  std::ofstream out(path);
  out << json.dump(2) << '\n';
  if (!out) throw Error(ErrorCode::io_error, "cannot write " + path.string());
}

nlohmann::json read_json(const std::filesystem::path& path) {
  std::ifstream in(path);
  if (!in) throw Error(ErrorCode::io_error, "cannot read " + path.string());
  return nlohmann::json::parse(in);
}

nlohmann::json setting_json(const model::EffectSetting& setting) {
  nlohmann::json parameters = nlohmann::json::object();
  for (const auto& [name, value] : setting.parameters) parameters[name] = value;
  return {{"id", setting.id}, {"parameters", parameters}};
}

model::EffectSetting setting_from(const nlohmann::json& json) {
  model::EffectSetting setting{.id = json.at("id"), .parameters = {}};
  for (const auto& [name, value] : json.at("parameters").items())
    setting.parameters.emplace_back(name, value);
  return setting;
}

nlohmann::json by_channel(const std::map<recordings::Channel, double>& values) {
  nlohmann::json out = nlohmann::json::object();
  for (const auto& [channel, value] : values) out[std::string(channel_name(channel))] = value;
  return out;
}

}  // namespace

nlohmann::json truth_of(const Bench& b) {
  nlohmann::json effects = nlohmann::json::array(), physics = nlohmann::json::array();
  for (const auto& p : b.physics) physics.push_back(setting_json(p));
  for (std::size_t i = 0; i < b.effects.size(); ++i) {
    effects.push_back(setting_json(b.effects[i]));
    effects.back()["family"] = b.families[i];
    effects.back()["size"] = b.sizes[i];
    if (b.left > 0) effects.back()["over_left"] = b.sizes[i] / b.left;
  }
  std::string kind;
  for (const auto& [k, name] : enum_names(Kind{}))
    if (k == b.kind) kind = name;
  nlohmann::json names = nlohmann::json::array(), pasts = nlohmann::json::array();
  for (const auto& p : b.pasts) pasts.push_back(protocols::to_json(p));
  for (const auto& r : b.recordings) names.push_back(r.name);
  return {{"seed", b.seed},
          {"recordings", names},
          {"index", b.index},
          {"kind", kind_name(b.kind)},
          {"coloured", b.coloured},
          {"effects", effects},
          {"physics", physics},
          {"left", b.left},
          {"pasts", pasts},
          {"candidates", b.candidates},
          {"noise", by_channel(b.noise)},
          {"gain", by_channel(b.gain)},
          {"offset", by_channel(b.offset)},
          {"base", model::to_json(b.base)}};
}

void write_bench(const Bench& b, const std::string& folder) {
  std::filesystem::create_directories(folder);
  const std::filesystem::path path(folder);
  write_text(path / "model.json", model::to_json(b.handed));
  write_text(path / "truth.json", truth_of(b));
  for (const auto& r : b.recordings)
    recordings::write_recording((path / (r.name + ".h5")).string(), r.recording);
}

Bench read_truth(const std::string& folder) {
  const std::filesystem::path path(folder);
  const auto truth = read_json(path / "truth.json");
  Bench b;
  b.seed = truth.at("seed");
  b.index = truth.at("index");
  b.kind = kind_named(truth.at("kind").get<std::string>());
  b.coloured = truth.at("coloured");
  b.candidates = truth.at("candidates").get<std::vector<std::string>>();
  for (const auto& e : truth.at("effects")) {
    b.effects.push_back(setting_from(e));
    b.sizes.push_back(e.at("size"));
    b.families.push_back(e.at("family"));
  }
  for (const auto& p : truth.value("physics", nlohmann::json::array())) b.physics.push_back(setting_from(p));
  b.left = truth.value("left", 0.0);
  return b;
}

Bench read_bench(const std::string& folder) {
  const std::filesystem::path path(folder);
  Bench b = read_truth(folder);
  b.handed = model::model_from_json(read_json(path / "model.json"));
  const auto names = read_json(path / "truth.json").at("recordings").get<std::vector<std::string>>();
  for (const auto& name : names)
    b.recordings.push_back({name, recordings::read_recording((path / (name + ".h5")).string())});
  return b;
}

std::string name_of(int index) {
  return fmt::format("bench-{:03}", index);
}

}  // namespace ferrobench::campaign
