#include "protocols/protocol.h"

#include <cmath>
#include <utility>

#include "base/text_file.h"
#include "base/units.h"
#include "protocols/csv.h"
#include "protocols/expand.h"
#include "protocols/program.h"

namespace ferrobench::protocols {
namespace {

// Suggested samples on a sweep over the whole range at the largest slew.
constexpr double samples_per_sweep = 500;
constexpr std::size_t max_file_bytes = 16u << 20;

Program valid_program(const nlohmann::json& given) {
  std::vector<Problem> problems;
  auto program = read_program(given, problems);
  if (!problems.empty())
    throw Error(ErrorCode::bad_protocol, "the protocol is not valid", std::move(problems));
  return program;
}

Waveform play(const Program& program, LevelUnit unit) {
  Builder builder(program.header.start, std::move(unit));
  expand(program.segments, "", {}, builder);
  auto waveform = builder.finish();
  if (waveform.pieces().empty())
    throw Error(ErrorCode::bad_protocol, "the program cannot be played",
                Problem{.path = "/segments", .message = "never moves nor waits"});
  return waveform;
}

// To see whether it can be played: levels stay as written.
LevelUnit as_written(const Program& program) {
  return {.name = write_json(program.header.unit)};
}

// `rate` in Hz, of the program; 0: it will be one that is enough.
void demand_resolved(const Waveform& waveform, double rate) {
  std::vector<Problem> problems;
  for (std::size_t i = 0; i < waveform.pieces().size() && problems.size() < max_problems; ++i) {
    const auto& piece = waveform.pieces()[i];
    const bool own = piece.recorded.rate > 0;
    const double given = own ? piece.recorded.rate : rate;
    if (given == 0 || given >= piece.sampling * (1 - 1e-9)) continue;
    const auto path = (own ? waveform.place(i) : "") + "/sample_rate_Hz";
    if (!problems.empty() && problems.back().path == path) continue;
    problems.push_back({.path = path,
                        .message = "does not resolve the sine of its small-signal segments",
                        .given = given,
                        .allowed = {{"from", piece.sampling}},
                        .unit = "Hz",
                        .hint = "sample faster, lower the frequency, or leave it out"});
  }
  if (!problems.empty())
    throw Error(ErrorCode::bad_protocol, "the protocol is sampled too slowly", std::move(problems));
}

// 1, 2, 5, 10, 20, ...: the first at or above x.
double round_up(double x) {
  const double decade = std::pow(10, std::floor(std::log10(x)));
  for (const double step : {1.0, 2.0, 5.0})
    if (step * decade >= x * (1 - 1e-9)) return step * decade;
  return 10 * decade;
}

}  // namespace

Protocol Protocol::from_json(const nlohmann::json& given) {
  const auto program = valid_program(given);
  demand_resolved(play(program, as_written(program)), program.header.sample_rate.value_or(0));
  Protocol protocol;
  protocol.json_ = given;
  return protocol;
}

Protocol Protocol::from_text(std::string_view text) {
  return from_json(parse_json_text(text, ErrorCode::bad_protocol, "the protocol", max_file_bytes));
}

Protocol Protocol::from_file(const std::string& path) {
  return from_text(read_text_file(path, max_file_bytes, ErrorCode::bad_protocol, Pipes::read));
}

Protocol Protocol::from_csv_file(const std::string& path) {
  std::vector<Problem> problems;
  const auto [points, unit] = read_points(
      read_text_file(path, max_file_bytes, ErrorCode::bad_protocol, Pipes::read), "", std::nullopt, problems);
  if (points.empty() && problems.empty()) problems.push_back({.message = "has no point"});
  if (!problems.empty())
    throw Error(ErrorCode::bad_protocol, "\"" + path + "\" is not a table of time and level",
                std::move(problems));
  return from_json({{"format", "ferrobench-protocol"},
                    {"version", 1},
                    {"name", "points"},
                    {"title", "Points from a file"},
                    {"unit", write_json(unit)},
                    {"start", points.front()[1]},
                    {"segments", {{{"kind", "points"}, {"points", points}}}}});
}

std::string Protocol::name() const {
  return json_.value("name", "");
}
std::string Protocol::title() const {
  return json_.value("title", name());
}

std::optional<double> Protocol::sample_rate() const {
  const auto program = valid_program(json_);
  if (program.header.sample_rate) return program.header.sample_rate;
  const auto waveform = play(program, as_written(program));
  const double sweep = waveform.maximum() - waveform.minimum();
  if (sweep == 0) return std::nullopt;
  // Of the segments that do not say it themselves; and slow ones may do so of all.
  double slew = 0, fewest = 0;
  for (const auto& piece : waveform.pieces()) {
    if (piece.recorded.rate > 0) continue;
    slew = std::max(slew, piece.max_slew());
    fewest = std::max(fewest, piece.sampling);
  }
  return round_up(std::max(std::clamp(samples_per_sweep * slew / sweep, 1.0, 1e5), fewest));
}

std::optional<Past> Protocol::past() const {
  return valid_program(json_).header.past;
}

ProtocolLoad Protocol::load() const {
  const auto fields = valid_program(json_).header.load;
  return {.spring_stiffness = fields.spring_stiffness, .prestress = fields.prestress};
}

std::optional<double> Protocol::layer_thickness() const {
  return valid_program(json_).header.layer_thickness;
}

bool Protocol::unattended() const {
  return json_.value("unattended", false);
}

std::map<std::string, double> Protocol::parameters() const {
  return valid_program(json_).parameters;
}

Protocol Protocol::with(const ExpandOptions& options) const {
  auto changed = json_;
  const auto known = parameters();
  std::vector<std::string> names;
  names.reserve(known.size());
  for (const auto& [name, value] : known) names.push_back(name);
  std::vector<Problem> problems;
  for (const auto& [name, value] : options.parameters) {
    changed["parameters"][name] = value;
    if (known.contains(name)) continue;
    const auto guess = nearest_name(name, names);
    problems.push_back({.path = fields_detail::pointer("/parameters", name),
                        .message = "is not a parameter of this protocol",
                        .given = value,
                        .allowed = names,
                        .hint = guess.empty() ? "" : "did you mean \"" + guess + "\"?"});
  }
  if (!problems.empty())
    throw Error(ErrorCode::bad_protocol, "the protocol has no such parameter", std::move(problems));
  if (options.layer_thickness != 0) changed["layer_thickness_m"] = options.layer_thickness;
  return from_json(changed);
}

Waveform Protocol::expand(const ExpandOptions& options) const {
  const auto program = valid_program(with(options).json_);
  auto unit = as_written(program);
  if (program.header.unit == Unit::kv_per_mm) {
    unit.unit = volts_per_m_in_kv_per_mm;
    return play(program, std::move(unit));
  }
  if (!program.header.layer_thickness)
    throw Error(ErrorCode::bad_protocol, "levels in V need a layer thickness",
                Problem{.path = "/layer_thickness_m",
                        .message = "is missing",
                        .unit = "m",
                        .hint = "give it in the protocol or take it from the specimen"});
  unit.divisor = *program.header.layer_thickness;
  return play(program, std::move(unit));
}

std::vector<Problem> validate(const nlohmann::json& given) {
  try {
    Protocol::from_json(given);
  } catch (const Error& error) {
    return error.problems();
  }
  return {};
}

}  // namespace ferrobench::protocols
