#include "server/engine/rerun.h"

#include <cmath>

namespace ferrobench::server {

using nlohmann::json;

namespace {

[[noreturn]] void refuse(const std::string& place, const std::string& message, const std::string& hint) {
  throw Error(ErrorCode::bad_recording, "the recording cannot be run again",
              Problem{.path = place, .message = message, .hint = hint});
}

std::optional<double> number_at(const json& object, const char* key) {
  if (!object.is_object() || !object.contains(key) || !object[key].is_number()) return std::nullopt;
  return object[key].get<double>();
}

// The virtual device's configuration, from what it says of itself.
json virtual_settings(const json& device) {
  json out;
  if (const auto v = number_at(device, "tolerance")) out["device.tolerance"] = *v;
  if (const auto v = number_at(device, "domains")) out["device.domains"] = *v;
  if (device.contains("output_range"))
    if (const auto v = number_at(device["output_range"], "max")) out["device.field_range"] = *v;
  for (const auto channel : {"field", "charge", "displacement", "force"})
    out[std::string("device.") + channel + ".enabled"] = false;
  if (!device.contains("channels") || !device["channels"].is_array())
    refuse("/entry/instrument/device", "does not name its channels", "");
  for (const auto& channel : device["channels"]) {
    if (!channel.is_object() || !channel.contains("channel") || !channel["channel"].is_string())
      refuse("/entry/instrument/device", "has a channel without a name", "");
    const auto place = "device." + channel["channel"].get<std::string>() + ".";
    out[place + "enabled"] = true;
    for (const auto key : {"range", "noise", "gain", "offset"})
      if (const auto v = number_at(channel, key)) out[place + key] = *v;
  }
  return out;
}

// The past without the way to the program's first level (run_header.cpp adds it), which the new run goes by
// itself.
protocols::Past before_the_way(const protocols::Past& past, double first_level) {
  constexpr double same = 1e-6;
  const bool has_it = first_level != 0 && past.kind == protocols::PastKind::visited &&
                      std::abs(past.levels.back().field - first_level) <= same * std::abs(first_level);
  return has_it ? protocols::without_last_level(past) : past;
}

}  // namespace

RunRequest rerun_request(const recordings::Recording& recording) {
  const auto& h = recording.header;
  const auto driver = h.device.is_object() && h.device.contains("driver") && h.device["driver"].is_string()
                          ? h.device["driver"].get<std::string>()
                          : "";
  if (driver.empty()) refuse("/entry/instrument/device", "names no driver", "its device is not known");
  if (driver == "replay")
    refuse("/entry/instrument/device", "is a replay",
           "rerun the recording that it plays: " + excerpt(h.device.value("source", "")));
  if (h.device.contains("mean_of"))
    refuse("/entry/instrument/device", "is of a mean over several passes",
           "rerun the recording that it was made of, which `mean_of` names");
  if (!h.protocol.is_object())
    refuse("/entry/protocol", "is missing", "without its program an experiment can only be replayed");

  RunRequest out;
  out.protocol = h.protocol;
  out.device = driver;
  out.rerun_of = h.entry_identifier;
  auto rate = number_at(h.device, "sample_rate_asked");
  if (!rate) rate = number_at(h.device, "sample_rate");
  if (rate) out.set["sample_rate_Hz"] = *rate;
  if (driver != "virtual") return out;
  if (!h.run_seed || !h.model.is_object())
    refuse(h.run_seed ? "/entry/model" : "/entry/run_seed", "is missing",
           "without it the samples would differ");
  out.model = h.model;
  out.seed = *h.run_seed;
  out.fast = true;
  out.set["prestress_Pa"] = h.load.prestress;
  out.set["spring_stiffness_N_per_m"] = h.load.spring_stiffness;
  if (h.past.known()) {
    const bool commanded = recording.has(recordings::Channel::command) && recording.size() > 0;
    out.set["device.past"] = to_json(
        commanded ? before_the_way(h.past, recording.at(recordings::Channel::command).front()) : h.past);
  }
  out.set.update(virtual_settings(h.device));
  return out;
}

}  // namespace ferrobench::server
