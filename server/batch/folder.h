// The folder of a batch, on a file system that all machines share:
//
//     batch.json              what is asked, by which program, in how many tasks
//     tasks/K.json            the items of task K, resolved
//     items/ID.json           an item's result; its pages, models and recordings lie in items/ID/
//     log/                    who worked how long on what, and what Slurm's tasks printed
//     job                     number of the job array that was submitted last
//     table.csv, table.h5, index.html      all results together
//
// Task K is the K-th stretch of `chunk` items of the manifest, whichever of them are to be done. A result is
// there whole or not at all, and says what it is the result of. Neither results nor what is made of them
// holds a time of day, a duration or a machine's name.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "server/batch/manifest.h"

namespace ferrobench::batch {

struct Plan {
  std::string format = "ferrobench-batch 1";
  Kind kind = Kind::discover;
  std::string version{}, commit{};
  std::int64_t items = 0, chunk = 1;
  std::string digest{};  // SHA-256 of all tasks
  std::int64_t tasks() const { return (items + chunk - 1) / chunk; }
};
template <class Visitor>
void describe(Visitor& visit, Plan& p) {
  visit("format", p.format, {.required = true});
  visit("kind", p.kind, {.required = true});
  visit("version", p.version, {.required = true});
  visit("commit", p.commit, {.required = true});
  visit("items", p.items, {.min = 1, .required = true});
  visit("chunk", p.chunk, {.min = 1, .required = true});
  visit("digest", p.digest, {.required = true});
}

// Of an item; `of_another_commit`: done, but not by this program.
enum class State { missing, outdated, of_another_commit, failed, done };

class BatchFolder {
 public:
  // Makes what is missing of it.
  explicit BatchFolder(const std::filesystem::path& folder);

  const std::filesystem::path& path() const { return folder_; }
  std::filesystem::path result(const std::string& id) const { return folder_ / "items" / (id + ".json"); }
  std::filesystem::path products(const std::string& id) const { return folder_ / "items" / id; }
  std::filesystem::path logs() const { return folder_ / "log"; }

  std::optional<Plan> plan() const;  // that was put there last; Error(bad_state) if it cannot be read
  static Plan make_plan(Kind kind, const std::vector<Item>& items, std::int64_t chunk);
  void put_plan(const Plan& plan, const std::vector<Item>& items) const;
  std::vector<Item> task(std::int64_t number) const;

  // The number of the job array under way, or "".
  std::string job() const;
  void put_job(const std::string& number) const;

 private:
  std::filesystem::path folder_;
};

// JSON as a file that is there whole or not at all.
void put_json(const std::filesystem::path& file, const nlohmann::json& value);
void put_text(const std::filesystem::path& file, const std::string& text);

std::string sha256_of_file(const std::string& path);  // as base/sha256.h

}  // namespace ferrobench::batch
