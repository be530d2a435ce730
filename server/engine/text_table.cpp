#include "server/engine/text_table.h"

#include <boost/uuid/random_generator.hpp>
#include <boost/uuid/uuid_io.hpp>
#include <charconv>
#include <cmath>
#include <sstream>

#include "recordings/iso_time.h"

namespace ferrobench::server {

using recordings::Channel;

namespace {

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> out;
  std::istringstream in(line);
  for (std::string cell; std::getline(in, cell, ',');) {
    const auto first = cell.find_first_not_of(" \t\r\"");
    const auto last = cell.find_last_not_of(" \t\r\"");
    out.push_back(first == std::string::npos ? "" : cell.substr(first, last - first + 1));
  }
  return out;
}

double number_in(const std::string& text, std::size_t line, const std::string& column,
                 std::vector<Problem>& problems) {
  double value = NAN;
  if (text.empty()) return value;
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (failure != std::errc{} || end != text.data() + text.size())
    problems.push_back({.path = "/csv",
                        .message = "line " + std::to_string(line) + ", column " + column + " is not a number",
                        .given = excerpt(text)});
  return value;
}

}  // namespace

recordings::Recording read_csv(const CsvImport& import) {
  recordings::Recording r;
  auto& h = r.header;
  h.title = import.title;
  h.start_time = recordings::iso_now();
  h.entry_identifier = to_string(boost::uuids::random_generator()());
  h.device = {{"driver", "import"}, {"source", import.source}};
  h.specimen = {import.specimen, import.length, import.area, import.layer_thickness, import.layer_count};
  h.load = {import.spring_stiffness, import.prestress};
  h.charge_reference = import.charge_is_absolute ? recordings::ChargeReference::absolute
                                                 : recordings::ChargeReference::first_sample;

  std::istringstream in(import.csv);
  std::string line;
  std::getline(in, line);
  const auto names = cells_of(line);
  std::vector<Problem> problems;
  struct Target {
    std::size_t at;
    ColumnMap map;
    std::vector<double>* values;
  };
  std::vector<Target> targets;
  const auto want = [&](const std::string& what, const ColumnMap& map, std::vector<double>& values) {
    const auto found = std::ranges::find(names, map.column);
    if (found == names.end())
      problems.push_back({.path = "/" + what + "/column",
                          .message = "is not in the first line",
                          .given = excerpt(map.column),
                          .allowed = names});
    targets.push_back({static_cast<std::size_t>(found - names.begin()), map, &values});
  };
  want("time", import.time, r.time);
  const std::array<const std::optional<ColumnMap>*, 5> maps{&import.command, &import.field, &import.charge,
                                                            &import.displacement, &import.force};
  for (const auto channel : recordings::all_channels)
    if (const auto& map = *maps.at(static_cast<std::size_t>(channel)))
      want(std::string(recordings::channel_name(channel)), *map, r.set(channel));

  for (std::size_t number = 2; problems.size() < 20 && std::getline(in, line); ++number) {
    const auto cells = cells_of(line);
    if (cells.empty() || cells.front().starts_with('#')) continue;
    for (const auto& t : targets)
      t.values->push_back(t.map.offset + t.map.scale * number_in(t.at < cells.size() ? cells[t.at] : "",
                                                                 number, t.map.column, problems));
    const auto rows = r.time.size();
    if (std::isnan(r.time.back()) || (rows > 1 && !(r.time[rows - 1] > r.time[rows - 2])))
      problems.push_back({.path = "/csv",
                          .message = "line " + std::to_string(number) + ": the time does not rise",
                          .unit = "s"});
  }
  if (r.time.size() < 2 && problems.empty())
    problems.push_back({.path = "/csv", .message = "has fewer than two rows"});
  if (!problems.empty())
    throw Error(ErrorCode::bad_recording, "the text is not a recording", std::move(problems));
  r.segments = infer_segments(r);
  r.end_time = recordings::iso_after(h.start_time, r.time.back() - r.time.front()).value_or(h.start_time);
  return r;
}

}  // namespace ferrobench::server
