// A protocol file read into structs: its header and its segments, parameters replaced.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/load_range.h"
#include "protocols/past.h"
#include "protocols/segments.h"

namespace ferrobench::protocols {

enum class Format { protocol };
std::span<const std::pair<Format, std::string_view>> enum_names(Format);

struct LoadFields {
  std::optional<double> spring_stiffness, prestress;
};
template <class Visitor>
void describe(Visitor& visit, LoadFields& load) {
  visit("spring_stiffness_N_per_m", load.spring_stiffness,
        {.unit = "N/m", .min = 0, .max = spring_stiffness_max});
  visit("prestress_Pa", load.prestress,
        {.unit = "Pa", .min = prestress_min, .max = prestress_max, .doc = "compression positive"});
}

struct Header {
  Format format = Format::protocol;
  std::int64_t version = 1;
  std::string schema, name, title, source, notes;
  Unit unit = Unit::kv_per_mm;
  std::optional<double> layer_thickness;
  std::optional<double> sample_rate;
  LoadFields load;
  std::optional<Past> past;
  bool unattended = false;
  nlohmann::json parameters = nlohmann::json::object();
  double start = 0;
  nlohmann::json segments;
};
template <class Visitor>
void describe(Visitor& visit, Header& h) {
  visit("$schema", h.schema,
        {.doc = "address or file of this schema, for an editor that checks what is written; not read here"});
  visit("format", h.format, {.required = true});
  visit("version", h.version, {.min = 1, .max = 1, .required = true});
  visit("name", h.name, {.required = true, .doc = "letters, digits, dots, dashes and underscores"});
  visit("title", h.title, {.doc = "one line for people"});
  visit("source", h.source, {.doc = "figure or table the experiment is taken from"});
  visit("notes", h.notes, {});
  visit("unit", h.unit, {.required = true, .doc = "of every level, and per second of every rate"});
  visit("layer_thickness_m", h.layer_thickness,
        {.unit = "m", .min = 0, .max = 1, .exclusive_min = true, .doc = "turns V into a field"});
  visit("sample_rate_Hz", h.sample_rate,
        {.unit = "Hz",
         .min = 0,
         .max = 1e7,
         .exclusive_min = true,
         .doc = "of segments that have none themselves"});
  visit("load", h.load, {.doc = "what the specimen works against"});
  visit("past", h.past, {.doc = "what the specimen has been through before"});
  visit("unattended", h.unattended,
        {.doc = "goes on to its end if the server dies or hangs; else the bench stops it safely then"});
  visit("parameters", h.parameters, {.doc = "named numbers, for $name in place of a number"});
  visit("start", h.start, level_info("level before the first segment"));
  visit("segments", h.segments, {.required = true});
}

inline constexpr std::string_view name_pattern = "^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$";
inline constexpr std::string_view parameter_name_pattern = "^[A-Za-z_][A-Za-z0-9_]{0,63}$";
inline constexpr std::string_view parameter_use_pattern = "^-?\\$[A-Za-z_][A-Za-z0-9_]{0,63}$";

struct Program {
  Header header;
  std::map<std::string, double> parameters;
  std::vector<Node> segments;
};

// Adds every problem; the program is fit for use only if there is none.
Program read_program(const nlohmann::json& given, std::vector<Problem>& problems);

}  // namespace ferrobench::protocols
