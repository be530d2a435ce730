// What a batch is asked to do: a list of items, each of which is what one call of discover, fit, report or
// import would be given.
//
//     {"model": "soft-pzt", "options": {"floor": 0.005},
//      "items": [{"id": "stack-017", "recordings": ["stack-017/loops.h5", "stack-017/creep.h5"]}, ...]}
//
// Paths are relative to the manifest. An item's own model wins over the manifest's, and its options are put
// over those of all.
#pragma once

#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/fields.h"
#include "recordings/exchange/kind.h"
#include "server/engine/fitting.h"
#include "server/engine/store.h"

namespace ferrobench::batch {

// Of a hundred thousand items with eight recordings each.
inline constexpr std::size_t most_manifest_bytes = 256u << 20;

enum class Kind { discover, fit, report, import };
std::span<const std::pair<Kind, std::string_view>> enum_names(Kind);
std::string kind_name(Kind kind);

// The options of an item, by kind; those of a fit are server::FitRequest.
struct DiscoverSettings {
  double floor = 0.002;
  std::int64_t seed = 1;
  std::vector<std::string> candidates{};
  bool report = true;
};
template <class Visitor>
void describe(Visitor& visit, DiscoverSettings& s) {
  visit("floor", s.floor,
        {.min = 0,
         .max = 1,
         .exclusive_min = true,
         .doc = "what is left counts as material above this share of a channel's range"});
  visit("seed", s.seed, {.min = 0, .doc = "of the recalibration's other starts"});
  visit("candidates", s.candidates, {.doc = "effects that may be named; absent: the whole catalogue"});
  visit("report", s.report, {.doc = "a page with pictures for each item"});
}
struct ReportSettings {
  bool report = true;
};
template <class Visitor>
void describe(Visitor& visit, ReportSettings& s) {
  visit("report", s.report, {.doc = "a page with pictures for each recording"});
}
struct ImportSettings {
  std::string as{};
  nlohmann::json map = nlohmann::json::object();
};
template <class Visitor>
void describe(Visitor& visit, ImportSettings& s) {
  visit("as", s.as, {.doc = "kind of the files; absent: found from their first lines"});
  visit("map", s.map, {.doc = "what stands in which column, and what is known of the specimen, in SI"});
}

// A recording or, for an import, a file of another program.
struct Input {
  std::string name{};  // the file's without its ending: what held_out and results call it
  std::string file{};  // as the manifest has it
  std::string path{};  // absolute
};
template <class Visitor>
void describe(Visitor& visit, Input& i) {
  visit("name", i.name, {.required = true});
  visit("file", i.file, {.required = true});
  visit("path", i.path, {.required = true});
}

// With everything filled in: it needs neither the manifest nor the data folder any more.
struct Item {
  std::string id{};
  nlohmann::json model = nullptr;
  std::vector<Input> inputs{};
  std::vector<std::string> held_out{};
  nlohmann::json options = nlohmann::json::object();
};
template <class Visitor>
void describe(Visitor& visit, Item& i) {
  visit("id", i.id, {.required = true});
  visit("model", i.model, {});
  visit("inputs", i.inputs, {.required = true});
  visit("held_out", i.held_out, {});
  visit("options", i.options, {});
}

// The options of an item as the struct of its kind; what is not given has its default. Problems lead to
// `path`.
template <class Settings>
Settings settings_of(const nlohmann::json& options, const std::string& path, std::vector<Problem>& problems) {
  Settings out;
  if constexpr (std::is_same_v<Settings, server::FitRequest>) out.report = true;
  read_json(options, out, path, problems);
  return out;
}
template <class Settings>
Settings settings_of(const Item& item) {
  std::vector<Problem> problems;
  auto out = settings_of<Settings>(item.options, "/options", problems);
  if (!problems.empty())
    throw Error(ErrorCode::invalid_params, "the options are not valid", std::move(problems));
  return out;
}

// In the manifest's order. Error(invalid_params) with all that is wrong, before anything is begun;
// Error(not_found) if there is no manifest.
std::vector<Item> read_manifest(Kind kind, const std::string& path, const server::Store& store);

}  // namespace ferrobench::batch
