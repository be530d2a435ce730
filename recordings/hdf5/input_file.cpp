#include "recordings/hdf5/input_file.h"

#include <array>
#include <cmath>
#include <cstdio>

#include "base/error.h"
#include "base/fields.h"
#include "recordings/format/others.h"
#include "recordings/format/sound.h"
#include "recordings/hdf5/input.h"

namespace ferrobench::recordings {
namespace {

using hdf5::Input;

constexpr const char* counts_place = "/entry/instrument/raw/ai";

double required(const Input& in, const std::string& place) {
  const auto value = in.number(place);
  if (!value) in.fail(place, "is missing");
  return *value;
}

double positive(const Input& in, const std::string& place) {
  const double value = required(in, place);
  if (!(value > 0)) in.fail(place, "must be above zero");
  return value;
}

double not_negative(const Input& in, const std::string& place) {
  const double value = required(in, place);
  if (value < 0) in.fail(place, "must not be negative");
  return value;
}

// JSON that cannot be read as such is kept as the text that it is.
nlohmann::json json_or_text(const Input& in, const std::string& place) {
  const auto text = in.text(place);
  if (!text) return nullptr;
  try {
    return parse_json_text(*text, ErrorCode::bad_recording, place, 32u << 20, 64);
  } catch (const Error&) {
    return *text;
  }
}

void check_definition(const Input& in) {
  const std::string place = "/entry/definition";
  const auto definition = in.text(place);
  if (!definition) in.fail(place, "is missing", "a recording has the text \"ferrobench_recording\" here");
  if (*definition != "ferrobench_recording") in.fail(place, "must be \"ferrobench_recording\"");
  const auto version = in.text_attribute(place, "version");
  if (!version) in.fail(place + "@version", "is missing");
  if (version != "1" && version != "1.0") in.fail(place + "@version", "must be 1, the version read here");
}

template <class E>
E named(const Input& in, const std::string& place) {
  const auto name = in.text(place);
  if (!name) in.fail(place, "is missing");
  std::string allowed;
  for (const auto& [value, known] : enum_names(E{})) {
    if (*name == known) return value;
    allowed += (allowed.empty() ? "one of " : ", ") + std::string(known);
  }
  in.fail(place, "is not a name that is known here: \"" + excerpt(*name) + "\"", allowed);
}

protocols::Past read_past(const Input& in) {
  const std::string group = "/entry/sample/past";
  protocols::Past out;
  if (!in.has(group)) return out;
  out.kind = named<protocols::PastKind>(in, group + "/kind");
  const bool visited = out.kind == protocols::PastKind::visited;
  if ((visited || out.kind == protocols::PastKind::cycled) && in.has(group + "/from"))
    out.from = named<protocols::FirstState>(in, group + "/from");
  if (out.kind == protocols::PastKind::partly_poled || out.from == protocols::FirstState::partly_poled) {
    const auto place = group + "/poling";
    out.poling = in.number(place);
    if (!out.poling) in.fail(place, "is missing", "what is partly poled has a degree from -1 to 1");
    if (std::abs(*out.poling) > 1) in.fail(place, "is no degree of poling", "from -1 to 1");
  }
  if (!visited) return out;
  const auto column = [&](const char* name) {
    const auto place = group + "/" + name;
    if (!in.has(place))
      in.fail(place, "is missing", "the kind visited has a field and seconds for each level");
    const auto rows = in.numeric_size(place).rows;
    if (rows == 0 || rows > protocols::most_visited_levels)
      in.fail(place, "must have 1 to " + std::to_string(protocols::most_visited_levels) + " levels, not " +
                         std::to_string(rows));
    return in.numbers(place, rows);
  };
  const auto fields = column("field"), seconds = column("seconds");
  if (fields.size() != seconds.size()) in.fail(group + "/seconds", "differs in length from field");
  for (std::size_t i = 0; i < fields.size(); ++i) {
    if (!(std::abs(fields[i]) <= protocols::highest_visited_field))
      in.fail(group + "/field", "is no field of a bench at level " + std::to_string(i));
    if (!(seconds[i] > 0 && seconds[i] <= protocols::longest_leg))
      in.fail(group + "/seconds", "must be above zero and not endless at level " + std::to_string(i));
    out.levels.push_back({fields[i], seconds[i]});
  }
  return out;
}

Header read_header(const Input& in) {
  check_definition(in);
  Header h;
  h.title = in.text("/entry/title").value_or("");
  h.start_time = in.text("/entry/start_time").value_or("");
  h.entry_identifier = in.text("/entry/entry_identifier").value_or("");
  h.run_seed = in.integer("/entry/run_seed");
  h.protocol = json_or_text(in, "/entry/protocol");
  h.model = json_or_text(in, "/entry/model");
  h.device = json_or_text(in, "/entry/instrument/device");
  h.specimen.name = in.text("/entry/sample/name").value_or("");
  h.specimen.length = positive(in, "/entry/sample/length_m");
  h.specimen.area = positive(in, "/entry/sample/area_m2");
  h.specimen.layer_thickness = positive(in, "/entry/sample/layer_thickness_m");
  positive(in, "/entry/sample/layer_count");
  h.specimen.layer_count = *in.integer("/entry/sample/layer_count");
  h.past = read_past(in);
  h.load.spring_stiffness = not_negative(in, "/entry/load/spring_stiffness_N_per_m");
  h.load.prestress = required(in, "/entry/load/prestress_Pa");  // below zero: tension

  const auto charge = channel_place(Channel::charge);
  if (in.has(charge)) {
    const auto reference = in.text_attribute(charge, "reference");
    if (!reference) in.fail(charge + "@reference", "is missing", R"("absolute" or "first_sample")");
    if (*reference != "absolute" && reference->find("first") == std::string::npos)
      in.fail(charge + "@reference", R"(must be "absolute" or "first_sample")");
    h.charge_reference = *reference == "absolute" ? ChargeReference::absolute : ChargeReference::first_sample;
  }
  return h;
}

// Lengths must be equal; while a run is being written, or where it broke off, what all columns have counts.
std::uint64_t read_length(const Input& in, const std::string& status, std::vector<Channel>& channels) {
  if (!in.has("/entry/data/time")) in.fail("/entry/data/time", "is missing");
  auto rows = in.numeric_size("/entry/data/time").rows;
  for (const auto channel : all_channels) {
    const auto place = channel_place(channel);
    if (!in.has(place)) continue;
    const auto length = in.numeric_size(place).rows;
    if (length != rows && !is_open(status)) in.fail(place, "differs in length from time");
    rows = std::min(rows, length);
    channels.push_back(channel);
  }
  if (!in.has(channel_place(Channel::field)) && !in.has(channel_place(Channel::command)))
    in.fail(channel_place(Channel::field), "is missing");
  return rows;
}

std::vector<SegmentRow> read_segments(const Input& in, std::uint64_t samples) {
  const std::string group = "/entry/segments/";
  if (!in.has("/entry/segments")) return {};
  const auto starts_place = group + "start_sample";
  if (!in.has(starts_place)) in.fail(starts_place, "is missing");
  const auto rows = in.numeric_size(starts_place).rows;
  if (rows > samples + 1) in.fail(starts_place, "has more segments than there are samples");
  const auto same_length = [&](const std::string& place, std::uint64_t length) {
    if (length != rows) in.fail(place, "differs in length from start_sample");
  };
  const auto starts = in.integers(starts_place, rows);
  for (const auto* name : {"end_sample", "level", "rate"})
    same_length(group + name, in.numeric_size(group + name).rows);
  const auto ends = in.integers(group + "end_sample", rows);
  const auto levels = in.numbers(group + "level", rows);
  const auto rates = in.numbers(group + "rate", rows);
  const auto kinds = in.texts(group + "kind");
  const auto labels = in.texts(group + "label");
  same_length(group + "kind", kinds.size());
  same_length(group + "label", labels.size());

  std::vector<SegmentRow> out;
  for (std::size_t i = 0; i < rows; ++i)
    out.push_back({starts[i], ends[i], kinds[i], labels[i], levels[i], rates[i]});
  return out;
}

std::vector<Event> read_events(const Input& in) {
  const std::string group = "/entry/events/";
  if (!in.has("/entry/events") || !in.has(group + "time")) return {};
  const auto rows = in.numeric_size(group + "time").rows;
  const auto times = in.numbers(group + "time", rows);
  const auto kinds = in.texts(group + "kind");
  const auto messages = in.texts(group + "message");
  if (kinds.size() != rows || messages.size() != rows)
    in.fail(group + "message", "differs in length from time");
  std::vector<Event> out;
  for (std::size_t i = 0; i < rows; ++i) out.push_back({times[i], kinds[i], messages[i]});
  return out;
}

// Raw counts of another program, without our scaling, are left where they are.
std::vector<RawColumn> read_raw(const Input& in) {
  const std::string place = counts_place;
  if (!in.has(place)) return {};
  const auto names = in.text_attributes(place, "channels");
  const auto gains = in.number_attributes(place, "gain");
  const auto offsets = in.number_attributes(place, "offset");
  if (names.empty() || gains.empty() || offsets.empty()) return {};
  if (in.numeric_size(place).columns != names.size() || gains.size() != names.size() ||
      offsets.size() != names.size())
    in.fail(place, "has another number of columns than its scaling");
  std::vector<RawColumn> columns;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto channel = std::ranges::find(all_channels, names[i], channel_name);
    if (channel == all_channels.end()) in.fail(place + "@channels", "names an unknown channel");
    columns.push_back({*channel, gains[i], offsets[i]});
  }
  return columns;
}

// What another program has put there, and what is no column of ours, is left where it is.
std::vector<ColumnName> read_others(const Input& in, std::uint64_t rows) {
  constexpr std::size_t longest = 64;
  const std::string group = "/entry/others";
  std::vector<ColumnName> out;
  if (!in.has(group)) return out;
  const auto is_name = [](const std::string& name) {
    return !name.empty() && name.size() <= longest && name != "time" &&
           name.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_") == std::string::npos;
  };
  for (const auto& name : in.text_attributes(group, "columns")) {
    const auto place = other_place(name);
    if (!is_name(name) || std::ranges::find(out, name, &ColumnName::name) != out.end())
      in.fail(group + "@columns", "names a column that cannot be one, or twice");
    if (out.size() >= most_other_columns) in.fail(group + "@columns", "names more columns than are read");
    if (const auto size = in.numeric_size(place); size.rows != rows || size.columns != 0)
      in.fail(place, "differs in length from time");
    out.push_back({name, in.text_attribute(place, "units").value_or(""),
                   in.text_attribute(place, "long_name").value_or("")});
  }
  return out;
}

std::string read_status(const Input& in) {
  return in.text("/entry/status").value_or("complete");
}

std::string read_reason(const Input& in) {
  if (const auto reason = in.text_attribute("/entry/status", "reason")) return *reason;
  return in.text_attribute("/entry", "reason").value_or("");
}

Frame read_frame(const Input& in) {
  Frame f;
  f.begin.header = read_header(in);
  f.ending.status = read_status(in);
  f.ending.reason = read_reason(in);
  f.ending.end_time = in.text("/entry/end_time").value_or("");
  f.rows = read_length(in, f.ending.status, f.begin.channels);
  return f;
}

std::string gigabytes(double bytes) {
  std::array<char, 32> text{};
  (void)std::snprintf(text.data(), text.size(), "%.3g GB", bytes / 1e9);
  return text.data();
}

}  // namespace

Frame summarize_hdf5(const std::string& path) {
  const Input in(path);
  auto f = read_frame(in);
  if (f.rows > 0) f.duration = in.span_of("/entry/data/time", f.rows);
  if (in.has("/entry/segments/start_sample"))
    f.segment_count = in.numeric_size("/entry/segments/start_sample").rows;
  if (in.has("/entry/events/time")) f.event_count = in.numeric_size("/entry/events/time").rows;
  return f;
}

Frame read_hdf5(const std::string& path, double most_bytes,
                const std::function<char*(std::uint64_t bytes)>& memory_for) {
  const Input in(path);
  auto f = read_frame(in);
  f.begin.raw = read_raw(in);
  f.begin.others = read_others(in, f.rows);
  const double bytes = static_cast<double>(f.rows) * static_cast<double>(f.begin.row_bytes());
  if (bytes > most_bytes)
    in.fail("/entry/data",
            "takes " + gigabytes(bytes) + " of memory, and at most " + gigabytes(most_bytes) +
                " are allowed on this machine",
            "cut it into parts with h5py or another program");
  f.ending.segments = read_segments(in, f.rows);
  f.events = read_events(in);
  for (const auto channel : all_channels)
    f.ending.noise.at(static_cast<std::size_t>(channel)) =
        in.number("/entry/noise/" + std::string(channel_name(channel)));

  // Each block is looked at as it comes, so that nonsense does not take long.
  auto* to = memory_for(f.column_bytes());
  const auto column = [&](const std::string& place, auto&& demand) {
    const std::span values(reinterpret_cast<double*>(to), f.rows);
    std::size_t looked_at = 0;
    in.numbers(place, values, [&](std::size_t done) {
      demand(values.first(done), looked_at);
      looked_at = done;
    });
    to += values.size_bytes();
  };
  column("/entry/data/time", [&](auto time, auto from) { demand_rising(time, from, path); });
  for (const auto channel : f.begin.channels)
    column(channel_place(channel),
           [&](auto values, auto from) { demand_finite(channel, values, from, path); });
  for (const auto& other : f.begin.others) column(other_place(other.name), [](auto&&, auto) {});
  if (!f.begin.raw.empty())
    in.counts(counts_place, f.begin.raw.size(),
              {reinterpret_cast<std::int16_t*>(to), f.rows * f.begin.raw.size()});
  return f;
}

}  // namespace ferrobench::recordings
