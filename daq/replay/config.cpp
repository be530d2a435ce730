#include "daq/replay/config.h"

namespace ferrobench::daq {

std::span<const std::pair<Played, std::string_view>> enum_names(Played) {
  static constexpr std::array<std::pair<Played, std::string_view>, 2> names{
      {{Played::counts, "counts"}, {Played::signals, "signals"}}};
  return names;
}

ReplayConfig replay_config_from_json(const nlohmann::json& json) {
  auto config = parse<ReplayConfig>(json.is_null() ? nlohmann::json::object() : json,
                                    ErrorCode::invalid_params, "the replay's configuration");
  for (const auto channel : recordings::all_channels)
    if (recalibrations(config)[static_cast<std::size_t>(channel)].gain == 0)
      throw Error(ErrorCode::invalid_params, "a gain of 0 leaves nothing of a channel",
                  Problem{.path = "/" + std::string(recordings::channel_name(channel)) + "/gain",
                          .given = 0,
                          .allowed = "any other number",
                          .hint = "1 leaves the calibration as it was"});
  return config;
}

std::array<Recalibration, 5> recalibrations(const ReplayConfig& c) {
  return {Recalibration{}, c.field, c.charge, c.displacement, c.force};
}

}  // namespace ferrobench::daq
