#include "server/batch/manifest.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <set>

#include "base/text_file.h"
#include "model/effects/catalogue.h"
#include "recordings/exchange/import.h"
#include "server/engine/request.h"

namespace ferrobench::batch {

using nlohmann::json;
namespace fs = std::filesystem;

std::span<const std::pair<Kind, std::string_view>> enum_names(Kind) {
  static constexpr std::array<std::pair<Kind, std::string_view>, 4> names{
      {{Kind::discover, "discover"}, {Kind::fit, "fit"}, {Kind::report, "report"}, {Kind::import, "import"}}};
  return names;
}

std::string kind_name(Kind kind) {
  return write_json(kind).get<std::string>();
}

namespace {

// A file's name may have 255 bytes, and ".json" and table numbers follow.
constexpr std::size_t longest_id = 200;

struct ManifestItem {
  std::string id{};
  json model = nullptr;
  std::vector<std::string> recordings{}, files{}, held_out{};
  json options = json::object();
};
template <class Visitor>
void describe(Visitor& visit, ManifestItem& i) {
  visit("id", i.id, {.required = true, .doc = "of the specimen: names the item's result"});
  visit("model", i.model, {.doc = "name, file or model; absent: that of all"});
  visit("recordings", i.recordings, {.doc = "files of recordings"});
  visit("files", i.files, {.doc = "what testers and other programs wrote, for an import"});
  visit("held_out", i.held_out,
        {.doc = "recordings to lock away for the proof of a discovery; absent: chosen"});
  visit("options", i.options, {.doc = "put over those of all"});
}
struct Manifest {
  json model = nullptr, options = json::object();
  std::vector<ManifestItem> items{};
};
template <class Visitor>
void describe(Visitor& visit, Manifest& m) {
  visit("model", m.model, {.doc = "of items that name none"});
  visit("options", m.options, {.doc = "of all items"});
  visit("items", m.items, {.required = true});
}

class ManifestReader {
 public:
  ManifestReader(Kind kind, const std::string& path, const server::Store& store)
      : kind_(kind), folder_(fs::absolute(path).parent_path()), store_(store) {}

  std::vector<Item> items(const Manifest& manifest) {
    if (manifest.items.empty()) complain("/items", "is empty: there is nothing to do");
    check_options(manifest.options, "/options");
    if (!problems.empty()) return {};
    std::vector<Item> out;
    for (std::size_t i = 0; i < manifest.items.size() && problems.size() < max_problems; ++i)
      out.push_back(item(manifest, i));
    return out;
  }

  std::vector<Problem> problems;

 private:
  void complain(const std::string& path, const std::string& message, json given = nullptr,
                json allowed = nullptr, const std::string& hint = "") {
    problems.push_back({.path = path,
                        .message = message,
                        .given = std::move(given),
                        .allowed = std::move(allowed),
                        .hint = hint});
  }

  Item item(const Manifest& manifest, std::size_t index) {
    const auto& given = manifest.items[index];
    const auto path = "/items/" + std::to_string(index);
    Item out{.id = given.id};
    check_id(given.id, path + "/id");
    const bool imports = kind_ == Kind::import;
    if (!(imports ? given.recordings : given.files).empty())
      complain(path + (imports ? "/recordings" : "/files"), "is not what " + kind_name(kind_) + " works on",
               nullptr, imports ? "files" : "recordings");
    out.inputs =
        inputs(imports ? given.files : given.recordings, path + (imports ? "/files" : "/recordings"));
    out.held_out = held_out(given, out.inputs, path + "/held_out");
    const bool own_model = !given.model.is_null();
    out.model = model(own_model ? given.model : manifest.model, own_model ? path + "/model" : "/model", path);
    if (given.options.is_object()) {
      auto merged = manifest.options;
      merged.update(given.options, true);
      out.options = check_options(merged, path + "/options");
    } else {
      complain(path + "/options", "is not an object", given.options);
    }
    return out;
  }

  void check_id(const std::string& id, const std::string& path) {
    const auto fit = [](char c) {
      return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
             c == '-' || c == '.';
    };
    if (id.empty() || id.size() > longest_id || id.front() == '.' || !std::ranges::all_of(id, fit))
      complain(path, "cannot be the name of a result", excerpt(id),
               "1 to 200 letters, digits and . _ -, the first no dot");
    else if (!ids_.insert(id).second)
      complain(path, "stands for two items", id, nullptr, "give each its own");
  }

  std::vector<Input> inputs(const std::vector<std::string>& files, const std::string& path) {
    if (files.empty()) complain(path, "is missing or empty");
    std::vector<Input> out;
    std::set<std::string> names;
    for (std::size_t i = 0; i < files.size() && problems.size() < max_problems; ++i) {
      const auto place = path + "/" + std::to_string(i);
      const auto absolute = (folder_ / files[i]).lexically_normal();
      std::error_code failure;
      if (!fs::is_regular_file(absolute, failure))
        complain(place, "is no file", absolute.string(), nullptr, "paths are relative to the manifest");
      const auto name = kind_ == Kind::import || absolute.extension() == ".h5" ? absolute.stem().string()
                                                                               : absolute.filename().string();
      if (!names.insert(name).second)
        complain(place, "has the name of another one of this item", name, nullptr,
                 "results call them by their names: give one another");
      out.push_back({name, files[i], absolute.string()});
    }
    return out;
  }

  std::vector<std::string> held_out(const ManifestItem& given, const std::vector<Input>& inputs,
                                    const std::string& path) {
    std::vector<std::string> out, names;
    names.reserve(inputs.size());
    for (const auto& i : inputs) names.push_back(i.name);
    if (!given.held_out.empty() && kind_ != Kind::discover)
      complain(path, "is only for discover");
    else if (!given.held_out.empty() && given.held_out.size() >= inputs.size())
      complain(path, "leaves nothing to learn from", given.held_out);
    for (std::size_t i = 0; i < given.held_out.size(); ++i) {
      const auto found = std::ranges::find_if(inputs, [&](const Input& input) {
        return given.held_out[i] == input.name || given.held_out[i] == input.file;
      });
      if (found == inputs.end())
        complain(path + "/" + std::to_string(i), "is none of the item's recordings", given.held_out[i],
                 names);
      else
        out.push_back(found->name);
    }
    return out;
  }

  // Each model is read once, and found wanting once.
  json model(const json& given, const std::string& path, const std::string& item) {
    const bool needed = kind_ == Kind::discover || kind_ == Kind::fit;
    if (!needed) {
      if (!given.is_null() && models_.emplace(path, nullptr).second)
        complain(path, "is only for discover and fit");
      return nullptr;
    }
    if (given.is_null()) {
      complain(item + "/model", "is missing, and the manifest has none for all");
      return nullptr;
    }
    auto [known, is_new] = models_.emplace(given.dump(), nullptr);
    if (!is_new) return known->second;
    try {
      const auto* name = given.get_ptr<const std::string*>();
      const bool is_file =
          name != nullptr && (name->find('/') != std::string::npos || name->ends_with(".json"));
      known->second =
          is_file ? model::to_json(model::model_from_file((folder_ / *name).lexically_normal().string()))
                  : server::resolve_model(given, store_);
    } catch (const Error& error) {
      complain(path, error.message(), name_in(given));
      for (const auto& p : error.problems())
        if (problems.size() < max_problems)
          problems.push_back({.path = path + p.path,
                              .message = p.message,
                              .given = p.given,
                              .allowed = p.allowed,
                              .unit = p.unit,
                              .hint = p.hint});
    }
    return known->second;
  }
  static json name_in(const json& given) { return given.is_string() ? given : json(nullptr); }

  // As they are with their defaults.
  json check_options(const json& options, const std::string& path) {
    switch (kind_) {
      case Kind::discover: {
        const auto s = settings_of<DiscoverSettings>(options, path, problems);
        check_effects(s.candidates, path + "/candidates");
        return write_json(s);
      }
      case Kind::fit: {
        const auto s = settings_of<server::FitRequest>(options, path, problems);
        if (!s.tables.empty()) complain(path + "/tables", "is not for a batch, which fits recordings");
        if (s.calibrate && options.value("report", false))
          complain(path + "/report", "does not go with a calibration, which fits nothing");
        auto out = write_json(s);
        if (s.calibrate) out["report"] = false;
        return out;
      }
      case Kind::report:
        return write_json(settings_of<ReportSettings>(options, path, problems));
      case Kind::import: {
        const auto s = settings_of<ImportSettings>(options, path, problems);
        if (!s.as.empty() && !recordings::source_kind(s.as)) {
          json names = json::array();
          for (const auto& [kind, name] : recordings::enum_names(recordings::SourceKind{}))
            names.push_back(name);
          complain(path + "/as", "is not a kind of file", s.as, names);
        }
        check_map(s.map, path + "/map");
        return write_json(s);
      }
    }
    return {};
  }

  void check_effects(const std::vector<std::string>& ids, const std::string& path) {
    for (std::size_t i = 0; i < ids.size(); ++i)
      if (std::ranges::none_of(model::effect_catalogue(),
                               [&](const model::Effect& e) { return e.id == ids[i] && !e.empirical; }))
        complain(path + "/" + std::to_string(i), "is no effect of the catalogue", ids[i], nullptr,
                 "model.effects has them");
  }

  void check_map(json map, const std::string& path) {
    if (!map.is_object()) return complain(path, "is not an object", map);
    for (const char* own : {"csv", "source"})
      if (map.contains(own)) complain(path + "/" + own, "is taken from the file");
    map["csv"] = "";
    recordings::CsvImport import;
    read_json(map, import, path, problems);
  }

  Kind kind_;
  fs::path folder_;
  const server::Store& store_;
  std::set<std::string> ids_;
  std::map<std::string, json> models_;
};

}  // namespace

std::vector<Item> read_manifest(Kind kind, const std::string& path, const server::Store& store) {
  const auto text = read_text_file(path, most_manifest_bytes, ErrorCode::invalid_params);
  const auto what = "the manifest \"" + path + "\"";
  const auto manifest =
      parse<Manifest>(parse_json_text(text, ErrorCode::invalid_params, what, most_manifest_bytes),
                      ErrorCode::invalid_params, what);
  ManifestReader reader(kind, path, store);
  auto items = reader.items(manifest);
  if (!reader.problems.empty())
    throw Error(ErrorCode::invalid_params, what + " is not valid; nothing was begun",
                std::move(reader.problems));
  return items;
}

}  // namespace ferrobench::batch
