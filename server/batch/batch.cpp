#include "server/batch/batch.h"

#include <fcntl.h>

#include <algorithm>
#include <cerrno>
#include <set>

#include "recordings/disk/new_file.h"
#include "recordings/format/version.h"
#include "server/batch/merge.h"

namespace ferrobench::batch {

namespace {

// MaxArraySize of Slurm is 1001 unless configured otherwise: numbers 0 to 1000.
constexpr std::int64_t most_tasks = 1000;

std::int64_t chunk_of(std::int64_t wanted, std::size_t items) {
  return wanted > 0
             ? wanted
             : std::max<std::int64_t>(1, (static_cast<std::int64_t>(items) + most_tasks - 1) / most_tasks);
}

recordings::Descriptor lock_folder(const BatchFolder& folder) {
  const auto path = (folder.path() / "lock").string();
  recordings::Descriptor file(open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666));
  if (!file) recordings::throw_write_failure(path, errno);
  // Where the file system knows no locks nobody is kept out; results are whole all the same.
  if (!recordings::try_lock(file) && recordings::is_locked(file))
    throw Error(
        ErrorCode::busy, "another command works in this folder",
        Problem{
            .path = "/out", .given = folder.path().string(), .hint = "wait for it, or name another folder"});
  return file;
}

}  // namespace

Batch::Batch(Kind kind, std::vector<Item> items, const std::filesystem::path& folder, BatchOptions options)
    : kind_(kind),
      items_(std::move(items)),
      folder_(folder),
      options_(std::move(options)),
      plan_(BatchFolder::make_plan(kind, items_, chunk_of(options_.chunk, items_.size()))),
      lock_(lock_folder(folder_)) {
  const auto before = folder_.plan();
  if (before && before->kind != kind)
    throw Error(ErrorCode::bad_state, "the folder holds a batch of another kind",
                Problem{.path = "/out",
                        .given = kind_name(before->kind),
                        .allowed = kind_name(kind),
                        .hint = "name another folder"});
}

bool Batch::is_planned() const {
  const auto there = folder_.plan();
  return there && write_json(*there) == write_json(plan_);
}

template <class Wanted>
void Batch::collect(Wanted wanted) {
  to_do_.clear();
  for (std::size_t i = 0; i < items_.size(); ++i) {
    const auto chunk = static_cast<std::size_t>(plan_.chunk);
    if (wanted(items_[i]))
      to_do_.push_back(
          {.task = static_cast<std::int64_t>(i / chunk), .index = i % chunk, .id = items_[i].id});
    tell("looking at what is there", 0);
  }
}

void Batch::prepare() {
  std::vector<std::string> stale, foreign;
  collect([&](const Item& item) {
    const auto state = state_of(kind_, item, folder_);
    if (state == State::of_another_commit) foreign.push_back(item.id);
    if (state == State::failed || state == State::outdated) stale.push_back(item.id);
    return state != State::done;
  });
  if (!foreign.empty() && !options_.replace)
    throw Error(
        ErrorCode::bad_state, "results of different commits of ferrobench are not put together",
        Problem{.path = "/out",
                .message = "has " + std::to_string(foreign.size()) + " results of another commit than " +
                           std::string(recordings::software_commit()),
                .given = foreign.front(),
                .hint =
                    "name another folder, go on with the program that made them, or add --replace to have "
                    "them done again"});
  stale.insert(stale.end(), foreign.begin(), foreign.end());
  if (!is_planned()) folder_.put_plan(plan_, items_);
  recordings::remove_leftovers((folder_.path() / "items").string());
  for (const auto& id : stale) {
    std::error_code gone;
    std::filesystem::remove(folder_.result(id), gone);
    if (gone) recordings::throw_write_failure(folder_.result(id).string(), gone.value());
  }
}

void Batch::join() {
  collect([&](const Item& item) { return read_result(item.id, folder_).is_null(); });
}

// By the folder's list, which another machine's file system brings up to date when it is opened; what it
// knows of single names may be a minute old.
std::vector<Place> Batch::missing() const {
  std::set<std::string> there;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path() / "items"))
    there.insert(entry.path().filename().string());
  std::vector<Place> out;
  for (const auto& place : to_do_)
    if (!there.contains(place.id + ".json")) out.push_back(place);
  return out;
}

bool Batch::tell(const std::string& stage, std::size_t over) const {
  return !options_.progress || options_.progress({.stage = stage, .over = over, .of = to_do_.size()});
}

bool Batch::run_here(int slots) const {
  return run_items(
      folder_, kind_, to_do_,
      {.slots = slots, .threads = options_.threads, .log = "local.jsonl", .go_on = [this](std::size_t over) {
         return tell(kind_name(kind_), over);
       }});
}

Summary Batch::merge() const {
  Summary out;
  std::vector<ItemResult> results;
  for (const auto& item : items_) {
    results.push_back({item.id, read_result(item.id, folder_)});
    const auto& result = results.back().result;
    ++(result.is_null() ? out.missing : result.at("state") == "done" ? out.done : out.failed);
  }
  put_merged(kind_, results, folder_);
  return out;
}

bool work_on_task(const BatchFolder& folder, std::int64_t task, int threads,
                  const std::function<bool()>& stop) {
  const auto plan = folder.plan();
  if (!plan || task < 0 || task >= plan->tasks())
    throw Error(ErrorCode::not_found, "the batch has no task " + std::to_string(task));
  if (plan->commit != recordings::software_commit() || plan->version != recordings::software_version())
    throw Error(ErrorCode::bad_state, "this machine has another ferrobench than the one that made the batch",
                Problem{.given = std::string(recordings::software_version()) + ", commit " +
                                 std::string(recordings::software_commit()),
                        .allowed = plan->version + ", commit " + plan->commit,
                        .hint = "install the same on all machines, best on a file system that they share"});
  std::vector<Place> places;
  for (const auto& item : folder.task(task)) places.push_back({task, places.size(), item.id});
  return run_items(folder, plan->kind, places,
                   {.slots = 1,
                    .threads = threads,
                    .log = "task-" + std::to_string(task) + ".jsonl",
                    .go_on = [&stop](std::size_t) { return !stop(); }});
}

}  // namespace ferrobench::batch
