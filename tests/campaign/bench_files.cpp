#include <filesystem>
#include <fstream>

#include "recordings/file.h"
#include "tests/campaign/bench.h"

namespace ferrobench::campaign {
namespace {

void write_text(const std::filesystem::path& path, const nlohmann::json& json) {
  std::ofstream out(path);
  out << json.dump(2) << '\n';
  if (!out) throw Error(ErrorCode::io_error, "cannot write " + path.string());
}

nlohmann::json by_channel(const std::map<recordings::Channel, double>& values) {
  nlohmann::json out = nlohmann::json::object();
  for (const auto& [channel, value] : values) out[std::string(channel_name(channel))] = value;
  return out;
}

}  // namespace

nlohmann::json truth_of(const Bench& b) {
  nlohmann::json effects = nlohmann::json::array();
  for (std::size_t i = 0; i < b.effects.size(); ++i) {
    nlohmann::json parameters = nlohmann::json::object();
    for (const auto& [name, value] : b.effects[i].parameters) parameters[name] = value;
    effects.push_back({{"id", b.effects[i].id},
                       {"family", b.families[i]},
                       {"parameters", parameters},
                       {"size", b.sizes[i]}});
  }
  std::string kind;
  for (const auto& [k, name] : enum_names(Kind{}))
    if (k == b.kind) kind = name;
  return {{"seed", b.seed},
          {"index", b.index},
          {"kind", kind},
          {"coloured", b.coloured},
          {"effects", effects},
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

}  // namespace ferrobench::campaign
