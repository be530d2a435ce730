// Loops of a real bulk ceramic as its tester wrote them: free of any load, 0.01, 0.1 and 1 Hz. The file may
// not be shipped, so who uses it asks first whether it is there.
#pragma once

#include <filesystem>
#include <fstream>
#include <sstream>

#include "recordings/format/recording.h"

namespace ferrobench::model {

inline std::filesystem::path ceramic_file() {
  return std::filesystem::path(FERROBENCH_SOURCE).parent_path() / "shared" / "data" / "measured" /
         "aixacct_piezo_loops.dat";
}

// One of its tables (from 1). SI; the displacement's sign is that of extension. The specimen had been poled
// towards - by the tester's own cycle before.
inline recordings::Recording ceramic_recording(int table) {
  constexpr double thickness = 0.8e-3, area = 60e-6;  // m, m^2
  std::ifstream file(ceramic_file());
  std::string line;
  const auto title = "Table " + std::to_string(table);
  int found = 0;
  while (found < (table == 1 ? 2 : 1) && std::getline(file, line))
    found += line.starts_with(title) && line.size() <= title.size() + 1;
  while (std::getline(file, line) && !line.starts_with("Time [s]")) {
  }
  std::vector<double> time, field, charge, displacement;
  while (std::getline(file, line)) {
    std::istringstream row(line);
    std::array<double, 10> v{};
    for (double& x : v)
      if (!(row >> x)) break;
    if (!row) break;
    time.push_back(v[0]);
    field.push_back(v[1] / thickness);
    charge.push_back(v[4] * 1e-2 * area);
    displacement.push_back(v[9] * 1e-9);
  }
  using recordings::Channel;
  recordings::Recording r;
  r.header.title = "table " + std::to_string(table);
  r.header.specimen = {"bulk ceramic", thickness, area, thickness, 1};
  r.time = time;
  r.set(Channel::field) = field;
  r.set(Channel::charge) = charge;
  r.set(Channel::displacement) = displacement;
  return r;
}

// From its largest field on: what was there before is no longer felt, and the specimen is poled towards +.
inline recordings::Recording ceramic_loop(int table) {
  using recordings::Channel;
  auto r = ceramic_recording(table);
  const auto& field = r.at(Channel::field);
  const auto top = std::ranges::max_element(field) - field.begin();
  const auto cut = [&](std::vector<double>& all) { all.erase(all.begin(), all.begin() + top); };
  cut(r.time);
  for (const auto channel : {Channel::charge, Channel::displacement, Channel::field})
    cut(*r.channels[static_cast<std::size_t>(channel)]);
  r.header.past = {protocols::PastKind::poled_plus};
  return r;
}

}  // namespace ferrobench::model
