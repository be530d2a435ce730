#include "recordings/exchange/import.h"

#include <filesystem>
#include <iostream>
#include <map>

#include "base/fields.h"
#include "base/headings.h"
#include "base/text_file.h"
#include "base/visible.h"
#include "recordings/file/writer.h"
#include "server/cli/link.h"
#include "server/cli/words.h"

namespace ferrobench::cli {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

constexpr std::size_t most_bytes = 1u << 30;

struct ImportOptions {
  std::vector<std::string> files{}, set{};
  std::string map{}, kind{}, out{};
  bool force = false;
};

std::string text_of(const std::string& file) {
  return read_text_file(file, most_bytes, ErrorCode::bad_recording, Pipes::read);
}

// The map's file, with what was set in it: "field.unit" is a key of a key.
json map_of(const ImportOptions& o) {
  json map = o.map.empty() ? json::object()
                           : parse_json_text(text_of(o.map), ErrorCode::invalid_params, "\"" + o.map + "\"");
  if (!map.is_object())
    throw Error(ErrorCode::invalid_params, "\"" + o.map + "\" is not a map of columns",
                Problem{.message = "is not an object"});
  const auto set = set_argument(o.set);
  for (const auto& [key, value] : set.items()) {
    auto path = "/" + key;
    std::ranges::replace(path, '.', '/');
    try {
      map[json::json_pointer(path)] = value;
    } catch (const json::exception&) {
      throw Error(ErrorCode::invalid_params, "what is known of the columns is not valid",
                  Problem{.path = "/set",
                          .message = "\"" + key + "\" leads to no key of the map",
                          .hint = "for example area_mm2=25 or field.unit=V"});
    }
  }
  return map;
}

// A length that was given in a unit of the user's own, "area_mm2", and what it is called in SI.
struct Renamed {
  std::string own, si;
  json given;
};

std::vector<Renamed> to_si(json& map) {
  struct Length {
    std::string name;
    Quantity quantity;
    std::string si;
  };
  const std::array lengths{Length{"length_", Quantity::displacement, "length_m"},
                           Length{"area_", Quantity::area, "area_m2"},
                           Length{"layer_thickness_", Quantity::displacement, "layer_thickness_m"}};
  std::vector<Renamed> out;
  for (const auto& [name, quantity, si] : lengths) {
    const std::array wanted{quantity};
    const auto before = map;
    for (const auto& [key, value] : before.items()) {
      if (!key.starts_with(name) || key == si) continue;
      const auto* unit = find_unit(std::string_view(key).substr(name.size()), wanted);
      if (unit == nullptr) continue;
      if (!value.is_number())
        throw Error(ErrorCode::invalid_params, "what is known of the columns is not valid",
                    Problem{.path = "/" + key,
                            .message = "must be a number",
                            .given = value,
                            .hint = "with a point before decimals, as 25.5"});
      if (map.contains(si))
        throw Error(ErrorCode::invalid_params, "what is known of the columns is not valid",
                    Problem{.path = "/" + key, .message = "is given twice: " + si + " says the same"});
      map[si] = value.get<double>() * unit->si;
      map.erase(key);
      out.push_back({"/" + key, "/" + si, value});
    }
  }
  return out;
}

// A problem with a length leads to the key and the value that the user gave; what is missing may be given in
// any unit.
Error in_own_units(const Error& error, const std::vector<Renamed>& renamed) {
  auto problems = error.problems();
  for (auto& problem : problems) {
    if (problem.path == "/area_m2" && problem.given.is_null())
      problem.hint += ", also as area_mm2 or area_um2";
    if (problem.path == "/layer_thickness_m" && problem.given.is_null())
      problem.hint += ", also as layer_thickness_um or layer_thickness_nm";
    if (problem.path == "/length_m" && problem.given.is_null()) problem.hint += ", also as length_mm";
    for (const auto& [own, si, given] : renamed) {
      if (problem.path != si) continue;
      problem.path = own;
      if (!problem.given.is_null()) problem.given = given;
    }
  }
  return {error.code(), error.message(), std::move(problems)};
}

std::vector<recordings::Imported> import_file(const ImportOptions& o, json map, const std::string& file) {
  const auto renamed = to_si(map);
  map["csv"] = "";
  if (!map.contains("title")) map["title"] = fs::path(file).stem().string();
  if (!map.contains("source")) map["source"] = fs::path(file).filename().string();
  const auto kind = recordings::source_kind(o.kind);
  try {
    auto import =
        parse<recordings::CsvImport>(map, ErrorCode::invalid_params, "what is known of the columns");
    import.csv = text_of(file);
    ProgressLine line;
    auto out =
        recordings::import_tables(import, kind, [&line](double share) { line.show("reading", share, -1); });
    line.finish();
    return out;
  } catch (const Error& e) {
    throw in_own_units(e, renamed);
  }
}

// Where the recordings of a file go: all of these places are free.
std::vector<std::string> targets_of(const ImportOptions& o, const std::string& file, std::size_t tables) {
  if (o.out.ends_with(".h5") && !fs::is_directory(o.out)) {
    if (o.files.size() > 1 || tables > 1)
      throw Error(ErrorCode::invalid_params, "one file cannot hold several recordings",
                  Problem{.path = "/out",
                          .given = o.out,
                          .allowed = "a folder, for " + (o.files.size() > 1
                                                             ? std::to_string(o.files.size()) + " files"
                                                             : std::to_string(tables) + " tables"),
                          .hint = "name a folder; each table becomes a recording in it"});
    return {o.out};
  }
  fs::create_directories(o.out);
  std::vector<std::string> out;
  const auto stem = fs::path(file).stem().string();
  for (std::size_t i = 1; i <= tables; ++i)
    out.push_back((fs::path(o.out) / (stem + recordings::table_suffix(i) + ".h5")).string());
  return out;
}

// "table 3", "tables 1 to 10", "tables 1, 4": those that a finding holds for.
std::string tables_in_words(const std::vector<std::size_t>& tables) {
  if (tables.size() == 1) return "table " + std::to_string(tables[0]);
  const bool all = tables.back() - tables.front() + 1 == tables.size();
  if (all && tables.size() > 2)
    return "tables " + std::to_string(tables.front()) + " to " + std::to_string(tables.back());
  std::string out = "tables";
  for (const auto& table : tables) out += (&table == tables.data() ? " " : ", ") + std::to_string(table);
  return out;
}

// On stderr: the recordings' names on stdout are for other programs.
void tell(const std::string& file, const std::vector<recordings::Imported>& imported) {
  std::vector<std::pair<recordings::Finding, std::vector<std::size_t>>> found;
  for (std::size_t i = 0; i < imported.size(); ++i)
    for (const auto& finding : imported[i].findings) {
      const auto same = std::ranges::find_if(found, [&finding](const auto& f) {
        return f.first.kind == finding.kind && f.first.message == finding.message;
      });
      if (same == found.end())
        found.push_back({finding, {i + 1}});
      else if (same->second.back() != i + 1)
        same->second.push_back(i + 1);
    }
  if (found.empty()) return;
  std::cerr << visible(file) << ":\n";
  for (const auto& [finding, tables] : found)
    std::cerr << "  " << finding.kind << (imported.size() > 1 ? ", " + tables_in_words(tables) : "") << ": "
              << visible(finding.message) << '\n';
}

// Files of one name would become the same recordings, and the last one alone would be left.
void demand_names_of_their_own(const ImportOptions& o) {
  std::map<std::string, std::string> files;
  for (const auto& file : o.files) {
    const auto [at, is_new] = files.emplace(fs::path(file).stem().string(), file);
    if (!is_new)
      throw Error(ErrorCode::invalid_params, "two files would become the same recordings",
                  Problem{.path = "/out",
                          .message = "has one place for \"" + at->second + "\" and \"" + file + "\"",
                          .given = o.out,
                          .hint = "import them into two folders, one by one"});
  }
}

int import(const ImportOptions& o, const Common& common) {
  const auto map = map_of(o);
  if (!o.out.empty()) demand_names_of_their_own(o);
  for (const auto& file : o.files) {
    std::vector<std::string> targets;
    try {
      const auto imported = import_file(o, map, file);
      tell(file, imported);
      if (o.out.empty()) {
        const server::Store store(common.data_folder());
        const auto stem = fs::path(file).stem().string();
        for (std::size_t i = 0; i < imported.size(); ++i) {
          const auto name = imported.size() == 1 ? stem : stem + recordings::table_suffix(i + 1);
          targets.push_back(store.add_recording(name, imported[i].recording).string());
        }
      } else {
        targets = targets_of(o, file, imported.size());
        std::vector<recordings::Existing> existing;
        existing.reserve(targets.size());
        for (const auto& target : targets) existing.push_back(demand_free(target, o.force, {file, o.map}));
        for (std::size_t i = 0; i < imported.size(); ++i)
          recordings::write_recording(targets[i], imported[i].recording, existing[i]);
      }
    } catch (const Error& e) {
      throw Error(e.code(), file + ": " + e.message(), e.problems());
    }
    for (const auto& target : targets) std::cout << target << '\n';
  }
  return exit_ok;
}

}  // namespace

void add_import(CLI::App& app, Common& common) {
  auto* sub = app.add_subcommand("import", "Make recordings of what testers and other programs wrote");
  auto o = std::make_shared<ImportOptions>();
  std::vector<std::string> kinds;
  for (const auto& [kind, name] : recordings::enum_names(recordings::SourceKind{})) kinds.emplace_back(name);
  sub->add_option("FILE", o->files, "exports of testers, or tables in text: CSV, TSV and their like")
      ->required();
  sub->add_option("--as", o->kind, "kind of the files; default: found from their first lines")
      ->check(one_of(kinds))
      ->type_name("KIND");
  sub->add_option("--map", o->map, "what stands in which column, and what is known of the specimen")
      ->type_name("MAP.json");
  sub->add_option("--set", o->set,
                  "a key of the map, for example length_m=0.03, area_mm2=25 or field.unit=V; again for more")
      ->type_name("KEY=VALUE")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  sub->add_option("--out", o->out,
                  "a folder, where each table becomes FILE-table-NN.h5; or a file, FILE.h5, for one table; "
                  "default: new recordings in the data folder")
      ->type_name("FOLDER");
  sub->add_flag("--force", o->force, "replace files that are there");
  sub->footer(
      "Kinds: aixacct (ASCII exports: Piezo, DynamicHysteresis, PulseResult, Leakage, Fatigue), radiant "
      "(Vision\n"
      "text: hysteresis, remanent hysteresis, leakage), b1500 (EasyEXPERT CSV with WGFMU channels), "
      "datavalue (its\n"
      "rows without the header), csv (any table in text).\n"
      "Testers say what their columns are, and most of the specimen; what is given wins: length_m, area_m2,\n"
      "layer_thickness_m, layer_count, or in other units (area_mm2, layer_thickness_nm). What was checked "
      "and\n"
      "found is printed, and kept in the recordings.\n"
      "In csv and datavalue, columns go by their headings: time, command, field or voltage, charge,\n"
      "displacement, force, current, polarization, with a unit as in time_s, \"field [kV/mm]\" or\n"
      "\"displacement in um\"; with a unit a symbol will do, as in \"E [kV/mm]\" or \"P / uC cm^-2\". A map\n"
      "wins: it names columns, gives their units, or their numbers where there are no headings:\n"
      "  {\"time\": {\"number\": 2}, \"field\": {\"number\": 3, \"unit\": \"V\"},\n"
      "   \"displacement\": {\"column\": \"x\", \"unit\": \"um\", \"scale\": -1},\n"
      "   \"length_m\": 0.03, \"area_m2\": 1e-4, \"layer_thickness_m\": 1e-4}\n"
      "A scale alone makes SI units; beside a unit it multiplies that. Other columns go along and are told.\n"
      "Other keys: sample_rate_Hz in place of time; delimiter, decimal_comma and header, which are found "
      "otherwise.\n"
      "Examples:\n"
      "  ferrobench import loops.dat pund.dat --out imported\n"
      "  ferrobench import loops.csv --map stage.json --out loops.h5\n"
      "  ferrobench import forc.csv --set area_um2=625 --set layer_thickness_nm=10 --out imported");
  sub->callback([o, &common] { common.action = [o, &common] { return import(*o, common); }; });
}

}  // namespace ferrobench::cli
