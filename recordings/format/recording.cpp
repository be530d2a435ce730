#include "recordings/format/recording.h"

namespace ferrobench::recordings {

nlohmann::json to_json(const Specimen& specimen) {
  return {{"name", specimen.name},
          {"length_m", specimen.length},
          {"area_m2", specimen.area},
          {"layer_thickness_m", specimen.layer_thickness},
          {"layer_count", specimen.layer_count}};
}

nlohmann::json to_json(const LoadCase& load) {
  return {{"spring_stiffness_N_per_m", load.spring_stiffness}, {"prestress_Pa", load.prestress}};
}

std::string_view channel_name(Channel channel) {
  constexpr std::array<std::string_view, 5> names{"command", "field", "charge", "displacement", "force"};
  return names.at(static_cast<std::size_t>(channel));
}

std::string_view channel_unit(Channel channel) {
  constexpr std::array<std::string_view, 5> units{"V/m", "V/m", "C", "m", "N"};
  return units.at(static_cast<std::size_t>(channel));
}

std::string other_place(const std::string& name) {
  return "/entry/others/" + name;
}

std::string channel_place(Channel channel) {
  return "/entry/data/" + std::string(channel_name(channel));
}

}  // namespace ferrobench::recordings
