#include "daq/guard/check.h"
#include "daq/registry.h"
#include "server/methods/methods.h"
#include "server/rpc/schemas.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;

struct ProtocolRow {
  std::string name{}, title{}, source{}, notes{}, unit{};
  json parameters = json::object();
  bool shipped = true;
  std::string error{};
};
template <class Visitor>
void describe(Visitor& visit, ProtocolRow& r) {
  visit("name", r.name, {.required = true});
  visit("title", r.title, {});
  visit("source", r.source, {.doc = "figure or table that shows it"});
  visit("notes", r.notes, {});
  visit("unit", r.unit, {.doc = "of levels; rates are in the same per second"});
  visit("parameters", r.parameters, {.doc = "what run.start may set, with its value"});
  visit("shipped", r.shipped, {.doc = "false: put here by protocol.put"});
  visit("error", r.error, {.doc = "why its file cannot be used; \"\" if it can"});
}
struct ProtocolList {
  std::vector<ProtocolRow> protocols{};
};
template <class Visitor>
void describe(Visitor& visit, ProtocolList& l) {
  visit("protocols", l.protocols, {.required = true});
}

struct ProtocolName {
  std::string name{};
};
template <class Visitor>
void describe(Visitor& visit, ProtocolName& p) {
  visit("name", p.name, {.required = true, .doc = "of a protocol, as protocol.list gives it"});
}
struct ProtocolText {
  json protocol{};
};
template <class Visitor>
void describe(Visitor& visit, ProtocolText& p) {
  visit("protocol", p.protocol, {.required = true, .doc = "as JSON; protocol.schema describes it"});
}

struct PutProtocol {
  std::string name{};
  json protocol{};
};
template <class Visitor>
void describe(Visitor& visit, PutProtocol& p) {
  visit("name", p.name, {.required = true, .doc = "to keep it under"});
  visit("protocol", p.protocol, {.required = true, .doc = "as JSON; protocol.schema describes it"});
}

struct PreviewParams {
  RunRequest request{};
  std::int64_t points = 1000;
};
template <class Visitor>
void describe(Visitor& visit, PreviewParams& p) {
  visit("protocol", p.request.protocol, {.required = true, .doc = "name of a protocol, or a protocol"});
  visit("model", p.request.model, {.doc = "as for run.start"});
  visit("set", p.request.set, {.doc = "as for run.start"});
  visit("max_points", p.points, {.min = 2, .max = 20000, .doc = "of the decimated waveform"});
}

struct PreviewSegment {
  std::string kind{}, label{}, path{};
  double start = 0, end = 0, level = 0, rate = 0;
  std::optional<double> center{}, amplitude{}, frequency{};
};
template <class Visitor>
void describe(Visitor& visit, PreviewSegment& s) {
  visit("kind", s.kind, {.doc = "ramp, hold or sine; a recording's segment table calls a sine a ramp"});
  visit("label", s.label, {.doc = "its name in the segment table"});
  visit("path", s.path, {.doc = "JSON pointer to the protocol's segment that it comes from"});
  visit("start_s", s.start, {.unit = "s"});
  visit("end_s", s.end, {.unit = "s"});
  visit("level", s.level, {.unit = "V/m"});
  visit("rate", s.rate, {.unit = "V/m/s"});
  visit("center", s.center, {.unit = "V/m", .doc = "of a sine"});
  visit("amplitude", s.amplitude, {.unit = "V/m", .doc = "of a sine"});
  visit("frequency_Hz", s.frequency, {.unit = "Hz", .doc = "of a sine"});
}

struct Preview {
  double duration = 0, sample_rate = 0, field_min = 0, field_max = 0, max_slew = 0;
  std::int64_t samples = 0, recorded = 0;
  std::vector<double> time{}, min{}, max{};
  std::vector<PreviewSegment> segments{};
  std::string unit{};
  double unit_size = 1;  // V/m
  json problems = json::array();
};
template <class Visitor>
void describe(Visitor& visit, Preview& p) {
  visit("duration_s", p.duration, {.unit = "s", .required = true});
  visit("samples", p.samples, {.required = true, .doc = "that the device takes"});
  visit("recorded_samples", p.recorded,
        {.required = true, .doc = "of them, where segments have sample rates of their own"});
  visit("sample_rate_Hz", p.sample_rate, {.unit = "Hz", .required = true, .doc = "of the device"});
  visit("field_min", p.field_min, {.unit = "V/m", .required = true});
  visit("field_max", p.field_max, {.unit = "V/m", .required = true});
  visit("max_slew", p.max_slew, {.unit = "V/m/s", .required = true});
  visit("time", p.time, {.unit = "s", .doc = "start of each stretch of the decimated waveform"});
  visit("min", p.min, {.unit = "V/m"});
  visit("max", p.max, {.unit = "V/m"});
  visit("segments", p.segments, {.doc = "the first 1000"});
  visit("unit", p.unit, {.doc = "in which the program was written"});
  visit("unit_V_per_m", p.unit_size, {.unit = "V/m", .doc = "size of that unit, on this specimen"});
  visit("problems", p.problems, {.doc = "limits that the program goes beyond; run.start would refuse it"});
}

// Exact extremes of each stretch: a stretch's ends and the corners within it.
void draw(const protocols::SampledWaveform& program, std::int64_t points, Preview& out) {
  const std::uint64_t count = program.size();
  const std::uint64_t bins = std::min<std::uint64_t>(count, static_cast<std::uint64_t>(points));
  auto corner = program.corners().begin();
  for (std::uint64_t bin = 0; bin < bins; ++bin) {
    const std::uint64_t first = bin * (count - 1) / bins;
    const std::uint64_t last = (bin + 1) * (count - 1) / bins;
    double low = program.value(first), high = low;
    const auto add = [&](std::uint64_t sample) {
      low = std::min(low, program.value(sample));
      high = std::max(high, program.value(sample));
    };
    add(last);
    while (corner != program.corners().end() && *corner < first) ++corner;
    for (auto at = corner; at != program.corners().end() && *at <= last; ++at) add(*at);
    constexpr std::uint64_t inside = 16;  // for sines, which have extremes of their own
    for (std::uint64_t i = 1; i < inside && last - first > inside; ++i)
      add(first + i * (last - first) / inside);
    out.time.push_back(static_cast<double>(first) / program.rate());
    out.min.push_back(low);
    out.max.push_back(high);
  }
}

PreviewSegment row_of(const protocols::Segment& s, const protocols::Piece& piece) {
  PreviewSegment row{s.kind, s.label, s.path, s.start, s.end, s.level, s.rate};
  if (piece.kind != protocols::PieceKind::sine) return row;
  row.kind = "sine";
  row.center = piece.center;
  row.amplitude = piece.amplitude;
  row.frequency = piece.frequency;
  return row;
}

Preview preview(const PreviewParams& p, Engine& engine) {
  auto request = p.request;
  request.fast = true;
  const auto plan = make_plan(request, engine.store());
  const auto device = daq::open_device("virtual", plan.device_config);
  const auto expanded = plan.protocol.expand();
  const double rate = std::max(plan.sample_rate, expanded.fastest_recorded());
  const protocols::SampledWaveform program(expanded, device->scan_rate(rate), plan.sample_rate);
  const auto& waveform = program.waveform();
  Preview out{.duration = waveform.duration(),
              .sample_rate = program.rate(),
              .field_min = waveform.minimum(),
              .field_max = waveform.maximum(),
              .max_slew = std::min(program.max_slew(), waveform.max_slew()),
              .samples = static_cast<std::int64_t>(program.size()),
              .recorded = static_cast<std::int64_t>(program.recorded_size()),
              .unit = waveform.unit().name,
              .unit_size = waveform.unit().field(1)};
  draw(program, p.points, out);
  for (std::size_t i = 0; i < std::min<std::size_t>(waveform.segments().size(), 1000); ++i)
    out.segments.push_back(row_of(waveform.segments()[i], waveform.pieces()[i]));
  for (const auto& problem : daq::check(program, engine.limits())) out.problems.push_back(to_json(problem));
  return out;
}

ProtocolRow row_of_protocol(const Store& store, const std::string& name) {
  const auto shipped = protocols::library_names();
  ProtocolRow out{.name = name, .title = name, .shipped = std::ranges::count(shipped, name) > 0};
  try {
    const auto text = store.protocol(name).json();
    out.title = text.value("title", name);
    out.source = text.value("source", "");
    out.notes = text.value("notes", "");
    out.unit = text.value("unit", "");
    out.parameters = text.value("parameters", json::object());
  } catch (const Error& error) {
    out.error = error.what();
  }
  return out;
}

}  // namespace

void add_protocol_methods(Dispatcher& rpc, Engine& engine) {
  rpc.add<NoParams>({.name = "protocol.list",
                     .doc = "The shipped experiments and those put here.",
                     .lane = Lane::heavy,
                     .errors = {ErrorCode::bad_protocol, ErrorCode::io_error}},
                    [&engine](const NoParams&) {
                      ProtocolList out;
                      for (const auto& name : engine.store().protocol_names())
                        out.protocols.push_back(row_of_protocol(engine.store(), name));
                      return out;
                    });
  rpc.add<ProtocolName>(
      {.name = "protocol.get",
       .doc = "A protocol by name.",
       .errors = {ErrorCode::not_found, ErrorCode::bad_protocol, ErrorCode::io_error}},
      [&engine](const ProtocolName& p) { return ProtocolText{engine.store().protocol(p.name).json()}; });
  rpc.add<PutProtocol>(
      {.name = "protocol.put",
       .doc = "Keeps a protocol under a name, which becomes its own.",
       .role = Role::control,
       .errors = {ErrorCode::bad_protocol, ErrorCode::busy, ErrorCode::io_error, ErrorCode::disk_full}},
      [&engine](const PutProtocol& p) { engine.store().put_protocol(p.name, p.protocol); });
  rpc.add<NoParams>({.name = "protocol.schema",
                     .doc = "JSON Schema of a protocol.",
                     .result_schema = schema::json_schema_document()},
                    [](const NoParams&) { return protocols::protocol_schema(); });
  rpc.add<ProtocolText>({.name = "protocol.validate",
                         .doc = "Every problem of a protocol with its path.",
                         .errors = {ErrorCode::bad_protocol},
                         .result_schema = schema::object(
                             {{"valid", schema::truth()}, {"problems", schema::list_of(schema::problem())}})},
                        [](const ProtocolText& p) {
                          auto problems = json::array();
                          for (const auto& problem : protocols::validate(p.protocol))
                            problems.push_back(to_json(problem));
                          const bool valid = problems.empty();
                          return json{{"valid", valid}, {"problems", std::move(problems)}};
                        });
  rpc.add<PreviewParams>(
      {.name = "protocol.preview",
       .doc = "What a run on the virtual device would do: its length, extremes and waveform.",
       .lane = Lane::heavy,
       .errors = {ErrorCode::not_found, ErrorCode::bad_protocol, ErrorCode::bad_model, ErrorCode::bad_state,
                  ErrorCode::io_error, ErrorCode::limit_exceeded}},
      [&engine](const PreviewParams& p) { return preview(p, engine); });
}

}  // namespace ferrobench::server
