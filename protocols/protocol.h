// A protocol: the experiment as its author wrote it, in JSON, and its expansion into a waveform.
//
//     { "format": "ferrobench-protocol", "version": 1, "name": "...", "title": "...", "source": "...",
//     "notes": "...",
//       "unit": "kV/mm" | "V",                 of every level and rate below; V needs a layer thickness to
//       expand "layer_thickness_m": 1e-4,             optional: the specimen that the program was written for
//       "sample_rate_Hz": 50,                  optional: of segments that have none themselves
//       "load": {"spring_stiffness_N_per_m": 2.7e6, "prestress_Pa": 4e6},            optional
//       "past": {"kind": "poled_minus"},       optional: what the specimen has been through (past.h)
//       "unattended": true,                    optional: goes on without a server, if that dies
//       "parameters": {"rate": 1.0},           optional: named numbers that `--set rate=10` overrides;
//       "$rate" uses one "start": 1.5,                          level before the first segment (default 0)
//       "segments": [ ... ] }
//
// In place of any number but `version` and the parameters themselves, "$rate" uses a parameter and "-$rate"
// its negative. The segments and their fields stand in protocols/segments.h, from which the JSON Schema is
// made.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "protocols/past.h"
#include "protocols/waveform.h"

namespace ferrobench::protocols {

struct ProtocolLoad {
  std::optional<double> spring_stiffness;  // N/m
  std::optional<double> prestress;         // Pa
};

struct ExpandOptions {
  double layer_thickness = 0;                  // m; 0: take the protocol's own
  std::map<std::string, double> parameters{};  // override the protocol's own
};

class Protocol {
 public:
  // Throws Error(bad_protocol) with every problem and its JSON pointer.
  static Protocol from_json(const nlohmann::json& given);
  static Protocol from_text(std::string_view text);
  static Protocol from_file(const std::string& path);  // Error(not_found) or Error(bad_protocol)
  // A field program from a CSV file of time and level (csv.h), in s and kV/mm where its headings name no
  // units; starts at the first level.
  static Protocol from_csv_file(const std::string& path);

  const nlohmann::json& json() const { return json_; }
  std::string name() const;
  std::string title() const;
  // Hz, of the segments that name none. If the file names none either: 500 samples or more on a sweep over
  // the whole range at their largest slew, and as many as small signals need.
  std::optional<double> sample_rate() const;
  std::optional<double> layer_thickness() const;  // m
  ProtocolLoad load() const;
  std::optional<Past> past() const;
  bool unattended() const;
  std::map<std::string, double> parameters() const;

  // The protocol as executed: parameter values and layer thickness replaced by those in `options`.
  // Throws Error(bad_protocol) if there is no such parameter or the value does not fit.
  Protocol with(const ExpandOptions& options) const;
  // In V/m. The level before the program is that of the first piece. Throws Error(bad_protocol) as with()
  // does, and if levels are in V and no thickness is known.
  Waveform expand(const ExpandOptions& options = {}) const;

 private:
  nlohmann::json json_;
};

// Every problem of the JSON, none if it is valid.
std::vector<Problem> validate(const nlohmann::json& given);
// The published JSON Schema (draft 2020-12) of a protocol file.
nlohmann::json protocol_schema();

// The shipped experiments (protocols/library/), by name.
std::vector<std::string> library_names();
Protocol library_protocol(std::string_view name);  // Error(not_found) with the nearest name

}  // namespace ferrobench::protocols
