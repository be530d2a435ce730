#include <cmath>
#include <filesystem>

#include "protocols/common/error.h"
#include "protocols/common/fields.h"
#include "recordings/file.h"
#include "recordings/hdf5_input.h"
#include "recordings/journal_reader.h"
#include "recordings/journal_writer.h"
#include "recordings/read_apart.h"

namespace ferrobench::recordings {
namespace {

using hdf5::Input;

double required(const Input& in, const std::string& place, bool positive) {
  const auto value = in.number(place);
  if (!value) in.fail(place, "is missing");
  if (*value < 0 || (positive && *value == 0))
    in.fail(place, positive ? "must be above zero" : "must not be negative");
  return *value;
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
  h.specimen.length = required(in, "/entry/sample/length_m", true);
  h.specimen.area = required(in, "/entry/sample/area_m2", true);
  h.specimen.layer_thickness = required(in, "/entry/sample/layer_thickness_m", true);
  required(in, "/entry/sample/layer_count", true);
  h.specimen.layer_count = *in.integer("/entry/sample/layer_count");
  h.load.spring_stiffness = required(in, "/entry/load/spring_stiffness_N_per_m", false);
  h.load.prestress = required(in, "/entry/load/prestress_Pa", false);

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
    if (length != rows && status != "running") in.fail(place, "differs in length from time");
    rows = std::min(rows, length);
    channels.push_back(channel);
  }
  if (!in.has(channel_place(Channel::field)) && !in.has(channel_place(Channel::command)))
    in.fail(channel_place(Channel::field), "is missing");
  return rows;
}

std::vector<double> read_time(const Input& in, std::uint64_t rows) {
  auto time = in.numbers("/entry/data/time", rows);
  for (std::size_t i = 0; i < time.size(); ++i) {
    if (!std::isfinite(time[i])) in.fail("/entry/data/time", "is not finite at sample " + std::to_string(i));
    if (i > 0 && !(time[i] > time[i - 1]))
      in.fail("/entry/data/time", "does not rise at sample " + std::to_string(i));
  }
  return time;
}

// NaN marks a gap; infinity is never measured.
std::vector<double> read_channel(const Input& in, Channel channel, std::uint64_t rows) {
  const auto place = channel_place(channel);
  auto values = in.numbers(place, rows);
  for (std::size_t i = 0; i < values.size(); ++i)
    if (std::isinf(values[i])) in.fail(place, "is infinite at sample " + std::to_string(i));
  return values;
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
  for (std::size_t i = 0; i < rows; ++i) {
    if (starts[i] < 0 || ends[i] < starts[i] || ends[i] > static_cast<std::int64_t>(samples))
      in.fail(group + "end_sample", "leaves the recording at segment " + std::to_string(i));
    if (!std::isfinite(levels[i]) || !std::isfinite(rates[i]))
      in.fail(group + "level", "is not finite at segment " + std::to_string(i));
    out.push_back({starts[i], ends[i], kinds[i], labels[i], levels[i], rates[i]});
  }
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
std::optional<Raw> read_raw(const Input& in, std::uint64_t rows) {
  const std::string place = "/entry/instrument/raw/ai";
  if (!in.has(place)) return std::nullopt;
  const auto names = in.text_attributes(place, "channels");
  const auto gains = in.number_attributes(place, "gain");
  const auto offsets = in.number_attributes(place, "offset");
  if (names.empty() || gains.empty() || offsets.empty()) return std::nullopt;
  if (in.numeric_size(place).columns != names.size() || gains.size() != names.size() ||
      offsets.size() != names.size())
    in.fail(place, "has another number of columns than its scaling");
  Raw raw;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto channel = std::ranges::find(all_channels, names[i], channel_name);
    if (channel == all_channels.end()) in.fail(place + "@channels", "names an unknown channel");
    raw.columns.push_back({*channel, gains[i], offsets[i]});
  }
  raw.counts = in.counts(place, rows);
  return raw;
}

std::string read_status(const Input& in) {
  return in.text("/entry/status").value_or("complete");
}

std::string read_reason(const Input& in) {
  if (const auto reason = in.text_attribute("/entry/status", "reason")) return *reason;
  return in.text_attribute("/entry", "reason").value_or("");
}

}  // namespace

Recording read_hdf5(const std::string& path) {
  const Input in(path);
  Recording r;
  r.header = read_header(in);
  r.status = read_status(in);
  r.reason = read_reason(in);
  r.end_time = in.text("/entry/end_time").value_or("");
  std::vector<Channel> channels;
  const auto rows = read_length(in, r.status, channels);
  r.time = read_time(in, rows);
  for (const auto channel : channels) r.set(channel) = read_channel(in, channel, rows);
  r.segments = read_segments(in, rows);
  r.events = read_events(in);
  for (const auto channel : all_channels)
    r.noise.at(static_cast<std::size_t>(channel)) =
        in.number("/entry/noise/" + std::string(channel_name(channel)));
  r.raw = read_raw(in, rows);
  return r;
}

Summary summarize_hdf5(const std::string& path) {
  const Input in(path);
  Summary s;
  s.path = path;
  s.header = read_header(in);
  s.status = read_status(in);
  s.reason = read_reason(in);
  s.end_time = in.text("/entry/end_time").value_or("");
  s.rows = read_length(in, s.status, s.channels);
  if (s.rows > 0) s.duration = in.span_of("/entry/data/time", s.rows);
  if (in.has("/entry/segments/start_sample"))
    s.segment_count = in.numeric_size("/entry/segments/start_sample").rows;
  if (in.has("/entry/events/time")) s.event_count = in.numeric_size("/entry/events/time").rows;
  return s;
}

namespace {

// The file, or its journal where the file is not there yet. A run that ends in between has its file then.
template <class FromFile, class FromJournal>
auto read_either(const std::string& path, FromFile&& from_file, FromJournal&& from_journal) {
  if (is_journal(path)) return from_journal(path);
  if (!std::filesystem::exists(path)) {
    try {
      return from_journal(journal_path(path));
    } catch (const Error& error) {
      if (error.code() != ErrorCode::not_found) throw;
    }
  }
  return from_file(path);
}

}  // namespace

Recording read_recording(const std::string& path) {
  return read_either(
      path,
      [](const std::string& file) {
        return has_checksums(file) ? read_hdf5(file) : read_journal(read_apart(file), file);
      },
      [](const std::string& journal) { return read_journal(journal); });
}

Summary read_summary(const std::string& path) {
  return read_either(
      path,
      [](const std::string& file) {
        return has_checksums(file) ? summarize_hdf5(file) : summarize_apart(file);
      },
      [](const std::string& journal) { return summarize_journal(journal); });
}

}  // namespace ferrobench::recordings
