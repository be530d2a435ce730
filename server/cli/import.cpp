#include <filesystem>
#include <iostream>

#include "base/text_file.h"
#include "recordings/exchange/import_csv.h"
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
  std::string map{}, kind = "csv", out{};
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
    map[json::json_pointer(path)] = value;
  }
  return map;
}

// A file of that name, or one in that folder.
std::string target_of(const ImportOptions& o, const std::string& file) {
  const auto stem = fs::path(file).stem().string();
  std::error_code failure;
  if (!fs::is_directory(o.out, failure) && !o.out.ends_with('/') && o.files.size() == 1) return o.out;
  fs::create_directories(o.out);
  return (fs::path(o.out) / (stem + ".h5")).string();
}

recordings::Recording import_file(const json& map, const std::string& file) {
  json params = map;
  params["csv"] = "";
  if (!params.contains("title")) params["title"] = fs::path(file).stem().string();
  if (!params.contains("source")) params["source"] = fs::path(file).filename().string();
  auto import =
      parse<recordings::CsvImport>(params, ErrorCode::invalid_params, "what is known of the columns");
  import.csv = text_of(file);
  return recordings::import_csv(import);
}

int import(const ImportOptions& o, const Common& common) {
  const auto map = map_of(o);
  for (const auto& file : o.files) {
    std::string target;
    try {
      if (o.out.empty()) {
        const server::Store store(common.data_folder());
        target = store.add_recording(fs::path(file).stem().string(), import_file(map, file)).string();
      } else {
        target = target_of(o, file);
        const auto existing = demand_free(target, o.force, {file, o.map});
        recordings::write_recording(target, import_file(map, file), existing);
      }
    } catch (const Error& e) {
      throw Error(e.code(), file + ": " + e.message(), e.problems());
    }
    std::cout << target << '\n';
  }
  return exit_ok;
}

}  // namespace

void add_import(CLI::App& app, Common& common) {
  auto* sub = app.add_subcommand("import", "Make recordings of tables that other programs wrote");
  auto o = std::make_shared<ImportOptions>();
  sub->add_option("FILE", o->files, "tables in text: CSV, TSV and their like")->required();
  sub->add_option("--as", o->kind, "kind of the files")->check(one_of({"csv"}))->capture_default_str();
  sub->add_option("--map", o->map, "what stands in which column, and what is known of the specimen")
      ->type_name("MAP.json");
  sub->add_option("--set", o->set,
                  "a key of the map, for example length_m=0.03 or field.unit=V; again for more")
      ->type_name("KEY=VALUE")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  sub->add_option("--out", o->out, "a file, or a folder; default: new recordings in the data folder")
      ->type_name("FILE.h5");
  sub->add_flag("--force", o->force, "replace files that are there");
  sub->footer(
      "The specimen is always needed: length_m, area_m2 and layer_thickness_m. Without a map, columns go by "
      "their\n"
      "headings: time, command, field, charge, displacement, force, with a unit as in time_s, \"field "
      "[kV/mm]\" or\n"
      "\"displacement/um\". A map names columns, or gives their numbers where there are no headings:\n"
      "  {\"time\": {\"number\": 2}, \"field\": {\"number\": 3, \"unit\": \"V\"},\n"
      "   \"displacement\": {\"column\": \"x\", \"unit\": \"um\", \"scale\": -1},\n"
      "   \"length_m\": 0.03, \"area_m2\": 1e-4, \"layer_thickness_m\": 1e-4}\n"
      "Other keys: sample_rate_Hz in place of time; delimiter, decimal_comma and header, which are found "
      "otherwise.\n"
      "Examples:\n"
      "  ferrobench import loops.csv --map stage.json --out loops.h5\n"
      "  ferrobench import *.csv --set length_m=0.03 --set area_m2=1e-4 --set layer_thickness_m=1e-4 --out "
      "imported/");
  sub->callback([o, &common] { common.action = [o, &common] { return import(*o, common); }; });
}

}  // namespace ferrobench::cli
