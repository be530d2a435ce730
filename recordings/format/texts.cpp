#include "recordings/format/texts.h"

#include <algorithm>
#include <limits>

#include "base/error.h"
#include "base/fields.h"

namespace ferrobench::recordings {
namespace {

using nlohmann::json;

std::string dump(const json& value) {
  return value.dump(-1, ' ', false, json::error_handler_t::replace);
}

// JSON has no NaN.
double number_at(const json& object, const char* key) {
  const auto& value = object.at(key);
  return value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>();
}

// What a checksum holds for whole may still be no journal of ours.
template <class Read>
auto read(std::string_view text, const char* place, Read&& take) {
  const auto given = parse_json_text(text, ErrorCode::bad_recording, place, most_text, 128);
  try {
    return take(given);
  } catch (const json::exception& error) {
    throw Error(ErrorCode::bad_recording, "the journal does not hold a recording",
                Problem{.path = place, .message = error.what()});
  }
}

Channel channel_of(const json& name) {
  const auto found = std::ranges::find(all_channels, name.get<std::string>(), channel_name);
  if (found == all_channels.end())
    throw Error(ErrorCode::bad_recording, "the journal names an unknown channel",
                Problem{.path = "/channels", .given = excerpt(name.get<std::string>())});
  return *found;
}

json noise_json(const std::array<std::optional<double>, 5>& noise) {
  auto out = json::object();
  for (const auto channel : all_channels)
    if (const auto& value = noise.at(static_cast<std::size_t>(channel)))
      out[std::string(channel_name(channel))] = *value;
  return out;
}

}  // namespace

std::string begin_text(const Begin& begin) {
  const auto& h = begin.header;
  json channels = json::array(), raw = json::array();
  for (const auto channel : begin.channels) channels.push_back(channel_name(channel));
  for (const auto& column : begin.raw)
    raw.push_back(
        {{"channel", channel_name(column.channel)}, {"gain", column.gain}, {"offset", column.offset}});
  json others = json::array();
  for (const auto& column : begin.others)
    others.push_back({{"name", column.name}, {"unit", column.unit}, {"long_name", column.long_name}});
  return dump(
      {{"format", "ferrobench-journal"},
       {"version", 1},
       {"title", h.title},
       {"start_time", h.start_time},
       {"entry_identifier", h.entry_identifier},
       {"run_seed", h.run_seed ? json(*h.run_seed) : json(nullptr)},
       {"protocol", h.protocol},
       {"model", h.model},
       {"device", h.device},
       {"sample", to_json(h.specimen)},
       {"load", to_json(h.load)},
       {"past", to_json(h.past)},
       {"charge_reference", h.charge_reference == ChargeReference::absolute ? "absolute" : "first_sample"},
       {"channels", channels},
       {"raw", raw},
       {"others", others}});
}

Begin begin_of(std::string_view text) {
  return read(text, "/begin", [](const json& given) {
    if (given.at("format") != "ferrobench-journal" || given.at("version") != 1)
      throw Error(ErrorCode::bad_recording, "the journal is of another kind",
                  Problem{.path = "/begin", .given = given.at("version"), .allowed = 1});
    Begin out;
    auto& h = out.header;
    h.title = given.at("title");
    h.start_time = given.at("start_time");
    h.entry_identifier = given.at("entry_identifier");
    if (const auto& seed = given.at("run_seed"); !seed.is_null()) h.run_seed = seed.get<std::int64_t>();
    h.protocol = given.at("protocol");
    h.model = given.at("model");
    h.device = given.at("device");
    const auto& sample = given.at("sample");
    h.specimen = {sample.at("name"), number_at(sample, "length_m"), number_at(sample, "area_m2"),
                  number_at(sample, "layer_thickness_m"), sample.at("layer_count")};
    const auto& load = given.at("load");
    h.load = {number_at(load, "spring_stiffness_N_per_m"), number_at(load, "prestress_Pa")};
    // Journals of before there was a past have none.
    if (given.contains("past"))
      h.past = protocols::past_from_json(given.at("past"), ErrorCode::bad_recording, "/begin/past");
    h.charge_reference = given.at("charge_reference") == "absolute" ? ChargeReference::absolute
                                                                    : ChargeReference::first_sample;
    for (const auto& name : given.at("channels")) {
      const auto channel = channel_of(name);
      if (std::ranges::count(out.channels, channel) > 0)
        throw Error(ErrorCode::bad_recording, "the journal names a channel twice",
                    Problem{.path = "/channels", .given = channel_name(channel)});
      out.channels.push_back(channel);
    }
    for (const auto& column : given.at("raw"))
      out.raw.push_back(
          {channel_of(column.at("channel")), number_at(column, "gain"), number_at(column, "offset")});
    for (const auto& column : given.value("others", json::array()))
      out.others.push_back({column.at("name"), column.at("unit"), column.at("long_name")});
    return out;
  });
}

std::string event_text(const Event& event) {
  return dump({{"time", event.time}, {"kind", event.kind}, {"message", event.message}});
}

Event event_of(std::string_view text) {
  return read(text, "/event", [](const json& given) {
    return Event{number_at(given, "time"), given.at("kind"), given.at("message")};
  });
}

std::string ending_text(const Ending& ending) {
  json segments = json::array();
  for (const auto& s : ending.segments)
    segments.push_back({{"start", s.start_sample},
                        {"end", s.end_sample},
                        {"kind", s.kind},
                        {"label", s.label},
                        {"level", s.level},
                        {"rate", s.rate}});
  return dump({{"end_time", ending.end_time},
               {"status", ending.status},
               {"reason", ending.reason},
               {"segments", segments},
               {"noise", noise_json(ending.noise)},
               {"rows_lost", ending.rows_lost}});
}

Ending ending_of(std::string_view text) {
  return read(text, "/end", [](const json& given) {
    Ending out{given.at("end_time"),
               given.at("status"),
               given.at("reason"),
               {},
               {},
               given.value("rows_lost", std::uint64_t{0})};
    for (const auto& s : given.at("segments"))
      out.segments.push_back({s.at("start"), s.at("end"), s.at("kind"), s.at("label"), number_at(s, "level"),
                              number_at(s, "rate")});
    for (const auto& [name, value] : given.at("noise").items())
      out.noise.at(static_cast<std::size_t>(channel_of(name))) = value.get<double>();
    return out;
  });
}

}  // namespace ferrobench::recordings
