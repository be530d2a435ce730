#include "server/engine/store.h"

#include <pwd.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <ctime>

#include "base/text_file.h"
#include "model/model.h"
#include "recordings/file/recover.h"
#include "recordings/file/writer.h"

namespace ferrobench::server {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view allowed_in_names =
    "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-";
constexpr std::size_t longest_name = 120;
constexpr std::size_t most_to_name = 40;            // where a name is not known, of those that are
constexpr std::size_t most_file_bytes = 16u << 20;  // of a model or a protocol

std::string utc_stamp() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  gmtime_r(&now, &parts);
  char text[32];
  const auto length = std::strftime(text, sizeof text, "%Y%m%dT%H%M%SZ", &parts);
  return {text, length};
}

std::string without_suffix(std::string name, std::string_view suffix) {
  if (name.ends_with(suffix)) name.resize(name.size() - suffix.size());
  return name;
}

// A link may lead anywhere, out of the store too.
bool is_plain_file(const fs::path& path) {
  std::error_code failure;
  return fs::is_regular_file(fs::symlink_status(path, failure));
}

void make_folder(const fs::path& folder) {
  std::error_code failure;
  fs::create_directories(folder, failure);
  if (failure)
    throw Error(ErrorCode::io_error, "the data folder cannot be made",
                Problem{.message = failure.message(),
                        .given = folder.string(),
                        .hint = "name another one: --data, or FERROBENCH_DATA in the environment"});
}

[[noreturn]] void throw_not_found(const std::string& what, const std::string& name,
                                  const std::vector<std::string>& names) {
  const auto guess = nearest_name(name, names);
  throw Error(ErrorCode::not_found, "there is no " + what + " \"" + excerpt(name) + "\"",
              Problem{.path = "/" + what,
                      .message = "is not known here",
                      .given = excerpt(name),
                      .allowed = names.empty() || names.size() > most_to_name ? nlohmann::json()
                                                                              : nlohmann::json(names),
                      .hint = guess.empty() ? what + ".list names them" : "did you mean \"" + guess + "\"?"});
}

// Names of the files there, among those that ship.
std::vector<std::string> with_files_of(const fs::path& folder, std::vector<std::string> names) {
  std::error_code failure;
  for (const auto& entry : fs::directory_iterator(folder, failure))
    if (entry.path().extension() == ".json") names.push_back(entry.path().stem().string());
  std::ranges::sort(names);
  return names;
}

void refuse_shipped(const std::string& what, const std::string& name,
                    const std::vector<std::string>& shipped) {
  if (std::ranges::count(shipped, name) > 0)
    throw Error(
        ErrorCode::busy, "a shipped " + what + " has this name",
        Problem{.path = "/name", .message = "is taken", .given = name, .hint = "choose another name"});
}

void put_json(const fs::path& path, const nlohmann::json& content) {
  ferrobench::recordings::NewFile file(path.string(), ferrobench::recordings::Existing::replace);
  file.write(content.dump(2) + '\n');
  file.put();
}

}  // namespace

fs::path default_data_folder() {
  if (const char* set = std::getenv("FERROBENCH_DATA"); set != nullptr && *set != 0) return set;
  if (const char* home = std::getenv("HOME"); home != nullptr && *home != 0)
    return fs::path(home) / ".local/share/ferrobench";
  if (const passwd* user = getpwuid(getuid()); user != nullptr)
    return fs::path(user->pw_dir) / ".local/share/ferrobench";
  throw Error(ErrorCode::io_error, "no place for recordings is known",
              Problem{.hint = "set FERROBENCH_DATA to a folder"});
}

void check_name(const std::string& name, const std::string& path) {
  const bool fit = !name.empty() && name.size() <= longest_name && name.front() != '.' &&
                   name.find_first_not_of(allowed_in_names) == std::string::npos;
  if (!fit)
    throw Error(ErrorCode::invalid_params, "this cannot be a name",
                Problem{.path = path,
                        .message = "is not fit for a file's name",
                        .given = excerpt(name),
                        .allowed = "letters, digits, '.', '_' and '-', not '.' first",
                        .hint = "names, not paths, are used here"});
}

Store::Store(fs::path folder) : folder_(std::move(folder)) {
  make_folder(recordings());
  make_folder(folder_ / "models");
  make_folder(folder_ / "protocols");
}

fs::path Store::new_recording(const std::string& stem) const {
  std::string name = stem.substr(0, 60);
  std::ranges::replace_if(
      name, [](char c) { return allowed_in_names.find(c) == std::string_view::npos; }, '-');
  if (name.empty() || name.front() == '.') name = "run" + name;
  const auto base = name + "_" + utc_stamp();
  auto path = recordings() / (base + ".h5");
  for (int i = 2; is_taken(path); ++i) path = recordings() / (base + "-" + std::to_string(i) + ".h5");
  return path;
}

std::optional<std::string> Store::download(const std::string& name) const {
  try {
    if (!name.ends_with(".csv")) return recording(name).string();  // no file yet while its run goes on
    check_name(name, "/name");
    return (recordings() / name).string();
  } catch (const Error&) {
    return std::nullopt;
  }
}

fs::path Store::add_recording(const std::string& stem,
                              const ferrobench::recordings::Recording& recording) const {
  for (;;) {
    auto path = new_recording(stem);
    try {
      write_recording(path.string(), recording, ferrobench::recordings::Existing::keep);
      return path;
    } catch (const ferrobench::recordings::NameTaken&) {  // by another program, just now
    }
  }
}

bool Store::is_taken(const fs::path& path) {
  return fs::exists(fs::symlink_status(path)) ||
         ferrobench::recordings::journal_state(path) != ferrobench::recordings::JournalState::none;
}

fs::path Store::recording(const std::string& name) const {
  check_name(name, "/recording");
  auto path = recordings() / (without_suffix(name, ".h5") + ".h5");
  if (!is_plain_file(ferrobench::recordings::present_file(path)))
    throw_not_found("recording", name, recording_names());
  return path;
}

std::vector<std::string> Store::recording_names() const {
  std::vector<std::pair<fs::file_time_type, std::string>> found;
  std::error_code failure;
  for (const auto& entry : fs::directory_iterator(recordings(), failure)) {
    const auto file = without_suffix(entry.path().filename().string(), ".journal");
    if (file.ends_with(".h5") && is_plain_file(entry.path()))
      found.emplace_back(entry.last_write_time(failure), without_suffix(file, ".h5"));
  }
  std::ranges::sort(found, std::greater{});
  std::vector<std::string> out;
  for (auto& [time, name] : found)  // a file and its journal are one recording
    if (std::ranges::find(out, name) == out.end()) out.push_back(std::move(name));
  return out;
}

std::vector<std::string> Store::model_names() const {
  return with_files_of(folder_ / "models", model::model_library_names());
}

nlohmann::json Store::model(const std::string& name) const {
  if (std::ranges::count(model::model_library_names(), name) > 0)
    return model::to_json(model::library_model(name));
  if (std::ranges::count(model_names(), name) == 0) throw_not_found("model", name, model_names());
  const auto file = (folder_ / "models" / (name + ".json")).string();
  return model::to_json(model::model_from_text(read_text_file(file, most_file_bytes, ErrorCode::bad_model)));
}

void Store::put_model(const std::string& name, const nlohmann::json& model) const {
  check_name(name, "/name");
  const auto checked = model::model_from_json(model);
  refuse_shipped("model", name, model::model_library_names());
  put_json(folder_ / "models" / (name + ".json"), model::to_json(checked));
}

std::vector<std::string> Store::protocol_names() const {
  return with_files_of(folder_ / "protocols", protocols::library_names());
}

protocols::Protocol Store::protocol(const std::string& name) const {
  if (std::ranges::count(protocols::library_names(), name) > 0) return protocols::library_protocol(name);
  if (std::ranges::count(protocol_names(), name) == 0) throw_not_found("protocol", name, protocol_names());
  const auto file = (folder_ / "protocols" / (name + ".json")).string();
  return protocols::Protocol::from_text(read_text_file(file, most_file_bytes, ErrorCode::bad_protocol));
}

void Store::put_protocol(const std::string& name, const nlohmann::json& protocol) const {
  check_name(name, "/name");
  auto named = protocol;
  if (named.is_object()) named["name"] = name;
  const auto checked = protocols::Protocol::from_json(named);
  refuse_shipped("protocol", name, protocols::library_names());
  put_json(folder_ / "protocols" / (name + ".json"), checked.json());
}

std::string default_model_name() {
  const auto names = model::model_library_names();
  const std::string usual = "nec-ae0505d08";
  return std::ranges::count(names, usual) > 0 || names.empty() ? usual : names.front();
}

}  // namespace ferrobench::server
