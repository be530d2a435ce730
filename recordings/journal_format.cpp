#include "recordings/journal_format.h"

#include <zlib.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "protocols/common/error.h"
#include "protocols/common/fields.h"

namespace ferrobench::recordings {
namespace {

using nlohmann::json;

static_assert(std::endian::native == std::endian::little, "the journal is written as it lies in memory");

constexpr std::uint32_t magic = 0x524a4246;  // "FBJR"

struct HeadBytes {
  std::uint32_t magic, kind;
  std::uint64_t sequence, bytes;
  std::uint32_t rows, payload_checksum, zero, head_checksum;
};
static_assert(sizeof(HeadBytes) == head_bytes);

std::uint32_t checksum(std::string_view bytes) {
  return static_cast<std::uint32_t>(crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

std::uint32_t own_checksum(const HeadBytes& head) {
  return checksum({reinterpret_cast<const char*>(&head), offsetof(HeadBytes, head_checksum)});
}

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
  const auto given = parse_json_text(text, ErrorCode::bad_recording, place, most_payload, 128);
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

std::string encode(RecordKind kind, std::uint64_t sequence, std::uint32_t rows, std::string_view payload) {
  HeadBytes head{
      magic, static_cast<std::uint32_t>(kind), sequence, payload.size(), rows, checksum(payload), 0, 0};
  head.head_checksum = own_checksum(head);
  std::string out(reinterpret_cast<const char*>(&head), sizeof head);
  return out.append(payload);
}

std::optional<RecordHead> decode_head(std::string_view bytes) {
  HeadBytes head{};
  if (bytes.size() < sizeof head) return std::nullopt;
  std::memcpy(&head, bytes.data(), sizeof head);
  if (head.magic != magic || head.zero != 0 || head.head_checksum != own_checksum(head) ||
      head.bytes > most_payload || head.kind < static_cast<std::uint32_t>(RecordKind::begin) ||
      head.kind > static_cast<std::uint32_t>(RecordKind::end))
    return std::nullopt;
  return RecordHead{static_cast<RecordKind>(head.kind), head.sequence, head.bytes, head.rows,
                    head.payload_checksum};
}

bool fits(const RecordHead& head, std::string_view payload) {
  return payload.size() == head.bytes && checksum(payload) == head.checksum;
}

Rows Columns::rows() const {
  Rows out{.time = time, .channels = {}, .counts = counts};
  for (std::size_t i = 0; i < channels.size(); ++i) out.channels.at(i) = channels.at(i);
  return out;
}

void Columns::clear() {
  time.clear();
  for (auto& channel : channels) channel.clear();
  counts.clear();
}

std::string begin_text(const Begin& begin) {
  const auto& h = begin.header;
  json channels = json::array(), raw = json::array();
  for (const auto channel : begin.channels) channels.push_back(channel_name(channel));
  for (const auto& column : begin.raw)
    raw.push_back(
        {{"channel", channel_name(column.channel)}, {"gain", column.gain}, {"offset", column.offset}});
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
       {"charge_reference", h.charge_reference == ChargeReference::absolute ? "absolute" : "first_sample"},
       {"channels", channels},
       {"raw", raw}});
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

std::optional<Event> loss_of(const Ending& ending, std::uint64_t rows, double last_time) {
  if (ending.rows_lost == 0) return std::nullopt;
  return Event{last_time, "gap",
               std::to_string(ending.rows_lost) + " of " + std::to_string(rows + ending.rows_lost) +
                   " samples are missing: those after this moment were measured and could not be recorded"};
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

std::string rows_payload(const Begin& begin, const Rows& rows, std::size_t first, std::size_t count) {
  std::string out;
  out.reserve(count * begin.row_bytes());
  const auto add = [&](const auto* values, std::size_t width) {
    out.append(reinterpret_cast<const char*>(values + first * width), count * width * sizeof *values);
  };
  add(rows.time.data(), 1);
  for (const auto channel : begin.channels)
    add(rows.channels.at(static_cast<std::size_t>(channel)).data(), 1);
  if (!begin.raw.empty()) add(rows.counts.data(), begin.raw.size());
  return out;
}

void add_rows(const Begin& begin, const RecordHead& head, std::string_view payload, Columns& out) {
  const auto take = [&](auto& column, std::size_t width) {
    const auto old = column.size(), count = head.rows * width;
    const auto bytes = count * sizeof column[0];
    column.resize(old + count);
    if (count > 0) std::memcpy(column.data() + old, payload.data(), bytes);
    payload.remove_prefix(bytes);
  };
  take(out.time, 1);
  for (const auto channel : begin.channels) take(out.channels.at(static_cast<std::size_t>(channel)), 1);
  take(out.counts, begin.raw.size());
}

}  // namespace ferrobench::recordings
