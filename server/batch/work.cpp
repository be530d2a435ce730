#include "server/batch/work.h"

#include <tbb/global_control.h>

#include <algorithm>
#include <boost/uuid/name_generator_sha1.hpp>
#include <boost/uuid/uuid_io.hpp>
#include <chrono>
#include <map>

#include "base/text_file.h"
#include "model/inference/parameters/parameters.h"
#include "model/inference/report/discovery_report.h"
#include "recordings/analysis/statistics.h"
#include "recordings/exchange/import.h"
#include "recordings/file/reader.h"
#include "recordings/file/writer.h"
#include "recordings/format/iso_time.h"
#include "recordings/format/version.h"
#include "recordings/reports/report.h"

namespace ferrobench::batch {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

constexpr std::size_t most_file_bytes = 1u << 30;  // of a result, and of a file to import

// What an item comes to.
struct Outcome {
  json rows = json::array();  // of the merged table: {column: number or text}
  json units = json::object();
  json result = json::object();
};

class Products {
 public:
  Products(const BatchFolder& folder, const std::string& id) : folder_(folder.products(id)) {}
  // Where it is to be put.
  std::string place(const std::string& name) {
    fs::create_directories(folder_);
    names_.push_back(name);
    return (folder_ / name).string();
  }
  void put(const std::string& name, const std::string& text) { put_text(place(name), text); }
  const std::vector<std::string>& names() const { return names_; }

 private:
  fs::path folder_;
  std::vector<std::string> names_;
};

// To the microsecond.
std::string modified(const std::string& path) {
  using namespace std::chrono;
  constexpr auto origin = sys_days(2020y / 1 / 1);
  const auto time = file_clock::to_sys(fs::last_write_time(path));
  const std::string begin = "2020-01-01T00:00:00.000000Z";
  return recordings::iso_after(begin, duration<double>(time - origin).count()).value_or(begin);
}

std::vector<recordings::Recording> read_inputs(const Item& item) {
  std::vector<recordings::Recording> out;
  for (const auto& input : item.inputs) out.push_back(recordings::read_recording(input.path));
  return out;
}

std::string effects_in_words(const std::vector<model::EffectEstimate>& effects) {
  std::string out;
  for (const auto& e : effects) out += (out.empty() ? "" : " + ") + e.id;
  return out;
}

Outcome discover(const Item& item, int threads, Products& products) {
  const auto settings = settings_of<DiscoverSettings>(item);
  std::vector<model::NamedRecording> recordings;
  for (auto& r : read_inputs(item)) recordings.push_back({item.inputs[recordings.size()].name, std::move(r)});
  model::DiscoverOptions options;
  options.held_out = item.held_out;
  options.candidates = settings.candidates;
  options.floor = settings.floor;
  options.seed = static_cast<std::uint64_t>(settings.seed);
  options.threads = threads;
  auto found = model::discover(model::model_from_json(item.model), std::move(recordings), options);
  found.asked.time.clear();
  found.health.seconds = 0;

  Outcome out;
  out.result = to_json(found);
  if (settings.report) products.put("report.html", html_report(found));
  products.put("improved.json", out.result.at("model").dump(2) + "\n");
  json row{{"verdict", out.result.at("verdict")},
           {"probability_unknown", found.probability_unknown},
           {"probability_nothing", found.probability_nothing},
           {"share", found.share},
           {"simulations", found.health.simulations}};
  const bool named = found.verdict == model::Verdict::named || found.verdict == model::Verdict::ambiguous;
  if (named && !found.explanations.empty()) {
    row["effects"] = effects_in_words(found.explanations.front().effects);
    row["probability"] = found.explanations.front().probability;
  }
  if (found.family) row["family"] = family_name(*found.family);
  if (!found.held_out.recordings.empty()) row["share_held_out"] = found.share_held_out;
  for (const auto& [channel, l] : found.left)
    row["left." + std::string(recordings::channel_name(channel))] = l.over_noise;
  for (const auto& added : found.added) {
    if (added.empirical) continue;
    for (const auto& p : added.term.parameters) {
      const auto key = added.term.id + "." + p.name;
      row[key] = p.value;
      row[key + ".low"] = p.low;
      row[key + ".high"] = p.high;
      for (const auto& known : model::find_effect(added.term.id).parameters)
        if (known.name == p.name)
          for (const char* end : {"", ".low", ".high"}) out.units[key + end] = known.unit;
    }
  }
  for (const auto& [path, r] : found.recalibrated) {
    row[path] = r.to;
    row[path + ".std"] = r.std;
    for (const char* end : {"", ".std"}) out.units[path + end] = model::parameter_unit(path);
  }
  out.rows.push_back(std::move(row));
  return out;
}

Outcome fit(const Item& item, Products& products) {
  const auto request = settings_of<server::FitRequest>(item);
  auto found = server::fit_model(request, model::model_from_json(item.model), read_inputs(item),
                                 [](const auto&) { return true; });
  if (found.contains("html")) products.put("report.html", found.at("html").get<std::string>());
  found.erase("html");
  products.put("fitted.json", found.at("model").dump(2) + "\n");
  Outcome out;
  json row = json::object();
  for (const auto& p : found.value("parameters", json::array())) {
    const auto path = p.at("path").get<std::string>();
    row[path] = p.at("to");
    row[path + ".std"] = p.at("std");
    for (const char* end : {"", ".std"}) out.units[path + end] = model::parameter_unit(path);
  }
  for (const char* cost : {"cost_before", "cost_after", "simulations"})
    if (found.contains(cost)) row[cost] = found.at(cost);
  out.rows.push_back(std::move(row));
  out.result = std::move(found);
  return out;
}

Outcome report(const Item& item, Products& products) {
  const auto settings = settings_of<ReportSettings>(item);
  Outcome out;
  for (const auto& input : item.inputs) {
    const auto recording = recordings::read_recording(input.path);
    const auto made = recordings::make_report(recording);
    json row{{"recording", input.name}};
    json tables = json::object();
    for (const auto& table : made.tables) {
      tables[table.key] = to_json(table);
      for (std::size_t c = 0; c < table.columns.size(); ++c) {
        std::vector<double> values;
        for (const auto& cells : table.rows)
          if (const auto* value = std::get_if<double>(&cells.at(c))) values.push_back(*value);
        if (values.empty()) continue;
        const auto key = table.key + "." + table.columns[c].key;
        row[key] = recordings::median(values);
        out.units[key] = table.columns[c].unit;
      }
    }
    out.rows.push_back(std::move(row));
    out.result[input.name] = std::move(tables);
    if (settings.report) products.put(input.name + ".html", render(made, recordings::Format::html));
  }
  return out;
}

// A recording's name and time of birth are usually this program's affair; here they follow from the file.
Outcome import(const Item& item, const json& asked, Products& products) {
  const auto settings = settings_of<ImportSettings>(item);
  Outcome out;
  for (std::size_t i = 0; i < item.inputs.size(); ++i) {
    const auto& input = item.inputs[i];
    const auto& about = asked.at("inputs").at(i);
    auto map = settings.map;
    map["csv"] = "";
    map["source"] = fs::path(input.file).filename().string();
    if (!map.contains("title")) map["title"] = input.name;
    auto wanted =
        parse<recordings::CsvImport>(map, ErrorCode::invalid_params, "what is known of the columns");
    wanted.csv = read_text_file(input.path, most_file_bytes, ErrorCode::bad_recording);
    auto imported = recordings::import_tables(wanted, recordings::source_kind(settings.as));
    for (std::size_t table = 1; table <= imported.size(); ++table) {
      auto& [recording, findings] = imported[table - 1];
      const auto name = imported.size() == 1 ? input.name : input.name + recordings::table_suffix(table);
      const auto seed = asked.dump(-1, ' ', false, json::error_handler_t::replace) + name;
      recording.header.entry_identifier =
          to_string(boost::uuids::name_generator_sha1(boost::uuids::ns::oid())(seed));
      recording.header.start_time = about.at("modified");
      const double seconds = recording.time.back() - recording.time.front();
      recording.end_time =
          recordings::iso_after(recording.header.start_time, seconds).value_or(recording.header.start_time);
      recordings::write_recording(products.place(name + ".h5"), recording);
      json told = json::array();
      std::string warnings;
      for (const auto& f : findings) {
        told.push_back({{"kind", f.kind}, {"message", f.message}});
        if (f.kind == "warning") warnings += (warnings.empty() ? "" : "; ") + f.message;
      }
      out.rows.push_back({{"recording", name},
                          {"duration", seconds},
                          {"samples", recording.size()},
                          {"findings", findings.size()},
                          {"warnings", warnings}});
      out.result[name] = {{"findings", told}};
    }
  }
  out.units["duration"] = "s";
  return out;
}

Outcome work_on(Kind kind, const Item& item, const json& asked, int threads, Products& products) {
  switch (kind) {
    case Kind::discover:
      return discover(item, threads, products);
    case Kind::fit:
      return fit(item, products);
    case Kind::report:
      return report(item, products);
    case Kind::import:
      return import(item, asked, products);
  }
  return {};
}

json failure(const Item& item, const json& asked, const Error& error) {
  auto told = error.data();
  told["message"] = error.message();
  return {{"id", item.id}, {"asked", asked}, {"state", "failed"}, {"error", std::move(told)}};
}

json asked_or_null(Kind kind, const Item& item) try { return asked_of(kind, item); } catch (const Error&) {
  return nullptr;
}

}  // namespace

json asked_of(Kind kind, const Item& item) {
  json inputs = json::array();
  for (const auto& input : item.inputs) {
    inputs.push_back({{"name", input.name}, {"file", input.file}, {"sha256", sha256_of_file(input.path)}});
    if (kind == Kind::import) inputs.back()["modified"] = modified(input.path);
  }
  return {{"kind", kind_name(kind)},
          {"software", recordings::software_version()},
          {"commit", recordings::software_commit()},
          {"model", item.model},
          {"inputs", std::move(inputs)},
          {"held_out", item.held_out},
          {"options", item.options}};
}

void carry_out(Kind kind, const Item& item, int threads, const BatchFolder& folder) {
  const auto asked = asked_or_null(kind, item);
  json result;
  // Whatever is done in parallel keeps to the threads of an item.
  const tbb::global_control most_threads(tbb::global_control::max_allowed_parallelism,
                                         static_cast<std::size_t>(std::max(1, threads)));
  try {
    Products products(folder, item.id);
    auto outcome = work_on(kind, item, asked.is_null() ? asked_of(kind, item) : asked, threads, products);
    if (asked_of(kind, item) != asked)
      throw Error(ErrorCode::bad_state, "an input has changed while it was worked on");
    result = {{"id", item.id},
              {"asked", asked},
              {"state", "done"},
              {"rows", std::move(outcome.rows)},
              {"units", std::move(outcome.units)},
              {"products", products.names()},
              {"result", std::move(outcome.result)}};
  } catch (const Error& error) {
    if (error.code() == ErrorCode::disk_full) throw;
    result = failure(item, asked, error);
  } catch (const std::exception& error) {
    result = failure(item, asked, Error(ErrorCode::internal, error.what()));
  }
  put_json(folder.result(item.id), result);
}

void put_failure(Kind kind, const Item& item, const Error& error, const BatchFolder& folder) {
  put_json(folder.result(item.id), failure(item, asked_or_null(kind, item), error));
}

json read_result(const std::string& id, const BatchFolder& folder) try {
  const auto file = folder.result(id).string();
  if (std::error_code none; !fs::is_regular_file(file, none)) return nullptr;
  auto out = parse_json_text(read_text_file(file, most_file_bytes, ErrorCode::bad_state),
                             ErrorCode::bad_state, file, most_file_bytes, 64);
  const bool whole =
      out.is_object() && out.value("id", "") == id && out.contains("asked") &&
      (text_at(out, "state") == "failed" ? out.contains("error")
                                         : text_at(out, "state") == "done" && out.contains("rows") &&
                                               out.contains("products") && out.contains("units"));
  return whole ? out : json(nullptr);
} catch (const std::exception&) {
  return nullptr;  // done again
}

State state_of(Kind kind, const Item& item, const BatchFolder& folder) {
  const auto result = read_result(item.id, folder);
  if (result.is_null()) return State::missing;
  if (result.at("state") == "failed") return State::failed;
  const auto asked = asked_or_null(kind, item);
  auto as_then = asked;
  for (const char* by : {"software", "commit"})
    if (as_then.is_object() && result.at("asked").is_object() && result.at("asked").contains(by))
      as_then[by] = result.at("asked").at(by);
  if (result.at("asked") != as_then) return State::outdated;
  if (asked != as_then) return State::of_another_commit;
  for (const auto& name : result.at("products"))
    if (std::error_code none;
        !name.is_string() || !fs::is_regular_file(folder.products(item.id) / name.get<std::string>(), none))
      return State::outdated;
  return State::done;
}

}  // namespace ferrobench::batch
