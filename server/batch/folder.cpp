#include "server/batch/folder.h"

#include <fcntl.h>

#include <array>
#include <cerrno>
#include <span>
#include <system_error>

#include "base/sha256.h"
#include "base/text_file.h"
#include "recordings/disk/new_file.h"
#include "recordings/format/version.h"

namespace ferrobench::batch {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

json read_json_file(const fs::path& file) {
  return parse_json_text(read_text_file(file.string(), most_manifest_bytes, ErrorCode::bad_state),
                         ErrorCode::bad_state, "\"" + file.string() + "\"", most_manifest_bytes, 64);
}

void make_folder(const fs::path& folder) {
  std::error_code failure;
  fs::create_directories(folder, failure);
  if (!fs::is_directory(folder))
    throw Error(ErrorCode::io_error, "the folder cannot be made",
                Problem{.path = "/out",
                        .message = failure.message(),
                        .given = folder.string(),
                        .hint = "name a folder on a disk that can be written to"});
}

}  // namespace

std::string sha256_of_file(const std::string& path) {
  const auto file = recordings::open_file(path, O_RDONLY | O_NONBLOCK | O_NOCTTY);
  std::error_code failure;
  if (!file || !fs::is_regular_file(path, failure))
    throw Error(file || errno == ENOENT ? ErrorCode::not_found : ErrorCode::io_error,
                "there is no file \"" + path + "\"");
  Sha256 sum;
  std::array<char, 1u << 16> portion{};
  for (std::uint64_t place = 0;;) {
    const auto got = recordings::read_at(file, place, portion.data(), portion.size());
    if (got.failure != 0)
      throw Error(ErrorCode::io_error, "\"" + path + "\" cannot be read",
                  Problem{.message = std::generic_category().message(got.failure)});
    if (got.count == 0) return sum.text();
    sum.add(std::as_bytes(std::span(portion).first(got.count)));
    place += got.count;
  }
}

void put_text(const fs::path& file, const std::string& text) {
  recordings::NewFile out(file.string(), recordings::Existing::replace);
  out.write(text);
  out.put();
}

void put_json(const fs::path& file, const json& value) {
  // What came from outside may be no UTF-8.
  put_text(file, value.dump(1, ' ', false, json::error_handler_t::replace) + "\n");
}

BatchFolder::BatchFolder(const fs::path& folder) : folder_(fs::absolute(folder).lexically_normal()) {
  for (const char* part : {"items", "tasks", "log"}) make_folder(folder_ / part);
}

std::optional<Plan> BatchFolder::plan() const {
  if (std::error_code none; !fs::exists(folder_ / "batch.json", none)) return std::nullopt;
  return parse<Plan>(read_json_file(folder_ / "batch.json"), ErrorCode::bad_state,
                     "\"" + (folder_ / "batch.json").string() + "\"");
}

Plan BatchFolder::make_plan(Kind kind, const std::vector<Item>& items, std::int64_t chunk) {
  return {.kind = kind,
          .version = std::string(recordings::software_version()),
          .commit = std::string(recordings::software_commit()),
          .items = static_cast<std::int64_t>(items.size()),
          .chunk = chunk,
          .digest = sha256_of(write_json(items).dump(-1, ' ', false, json::error_handler_t::replace))};
}

void BatchFolder::put_plan(const Plan& plan, const std::vector<Item>& items) const {
  for (std::int64_t k = 0; k < plan.tasks(); ++k) {
    const auto first = items.begin() + k * plan.chunk;
    const auto last = items.begin() + std::min(plan.items, (k + 1) * plan.chunk);
    put_json(folder_ / "tasks" / (std::to_string(k) + ".json"), write_json(std::vector<Item>(first, last)));
  }
  put_json(folder_ / "batch.json", write_json(plan));
}

std::vector<Item> BatchFolder::task(std::int64_t number) const {
  const auto file = folder_ / "tasks" / (std::to_string(number) + ".json");
  std::vector<Item> out;
  std::vector<Problem> problems;
  read_json(read_json_file(file), out, "", problems);
  if (!problems.empty())
    throw Error(ErrorCode::bad_state, "\"" + file.string() + "\" is no task", std::move(problems));
  return out;
}

std::string BatchFolder::job() const {
  if (std::error_code none; !fs::exists(folder_ / "job", none)) return "";
  auto text = read_text_file((folder_ / "job").string(), 100, ErrorCode::bad_state);
  while (!text.empty() && text.back() == '\n') text.pop_back();
  return text.find_first_not_of("0123456789") == std::string::npos ? text : "";
}

void BatchFolder::put_job(const std::string& number) const {
  put_text(folder_ / "job", number + "\n");
}

}  // namespace ferrobench::batch
