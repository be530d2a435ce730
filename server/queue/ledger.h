// What the queue has on the disk (queue.db in the data folder): plans, their items, and each run that was
// made for one. What a method returns from is there after a power cut. For any thread.
//
// An item is marked as running, with the id of its run and the name of its recording, before the run begins.
// So it is never run twice unknowingly: after a crash, what the recording says is what became of it.
#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "server/queue/database.h"
#include "server/queue/plan.h"

namespace ferrobench::server {

// waiting     its turn comes
// running     a run of it is under way
// complete    its program was played to the end
// aborted     somebody stopped it
// failed      it was refused, or a limit, the interlock or a fault ended it
// broken_off  a process or the machine died
enum class ItemState { waiting, running, complete, aborted, failed, broken_off };
std::span<const std::pair<ItemState, std::string_view>> enum_names(ItemState);

struct QueueItem {
  std::int64_t item = 0, plan = 0;
  std::string name{};
  nlohmann::json values = nlohmann::json::object();
  std::int64_t repeat = 1;
  ItemState state = ItemState::waiting;
  std::string reason{};
  std::string run{}, recording{};
  std::int64_t runs = 0;
};
template <class Visitor>
void describe(Visitor& visit, QueueItem& i) {
  visit("item", i.item, {.required = true, .doc = "its id"});
  visit("plan", i.plan, {.required = true, .doc = "id of its plan; a single run is one as well"});
  visit("name", i.name, {.doc = "of the plan"});
  visit("values", i.values, {.doc = "what it has of its own among the runs of the plan: settings by key"});
  visit("repeat", i.repeat, {.min = 1, .doc = "which of the repeats of these values"});
  visit("state", i.state, {.required = true});
  visit("reason", i.reason, {.doc = "why it is not complete"});
  visit("run", i.run, {.doc = "id of its latest run"});
  visit("recording", i.recording, {.doc = "of its latest run, if anything was recorded"});
  visit("runs", i.runs,
        {.min = 0, .doc = "made for it so far; more than one only where a broken one was repeated"});
}

struct ItemCounts {
  std::int64_t waiting = 0, running = 0, complete = 0, aborted = 0, failed = 0, broken_off = 0;
};
template <class Visitor>
void describe(Visitor& visit, ItemCounts& c) {
  visit("waiting", c.waiting, {.min = 0});
  visit("running", c.running, {.min = 0});
  visit("complete", c.complete, {.min = 0});
  visit("aborted", c.aborted, {.min = 0});
  visit("failed", c.failed, {.min = 0});
  visit("broken_off", c.broken_off, {.min = 0});
}

// Some items: one, or those of a plan.
struct ItemChoice {
  std::int64_t item = 0, plan = 0;  // one of them is 0
};

class Ledger {
 public:
  // In this folder. Error(io_error | disk_full).
  explicit Ledger(const std::filesystem::path& folder);

  struct Added {
    std::int64_t plan = 0, first = 0, count = 0;
  };
  // All of it or nothing. Error(limit_exceeded) if the queue is full.
  Added add(const Plan& plan);

  struct Page {
    std::vector<QueueItem> items{};
    std::int64_t total = 0;  // of those asked for
    ItemCounts counts{};     // of all
  };
  // In the order in which they run and have run. `plan` 0: of all.
  Page list(std::int64_t plan, std::optional<ItemState> state, std::int64_t first, std::int64_t count);
  // Before another item that waits; none: to the end. `first`: before all. How many moved.
  // Error(not_found), Error(bad_state) if it does not wait.
  std::int64_t move(ItemChoice which, std::optional<std::int64_t> before, bool first);
  // Forgets them; recordings stay. Error(not_found), Error(busy) while a run of it is under way.
  std::int64_t remove(ItemChoice which);

  struct Entry {
    QueueItem item{};
    Step step{};
    std::shared_ptr<const Plan> plan{};
    bool confirmed = false;   // queue.start was called since it was added
    nlohmann::json set_up{};  // what its operator has confirmed
  };
  std::optional<Entry> next();                    // that waits
  Entry entry(std::int64_t item);                 // Error(not_found)
  std::vector<Entry> running();                   // one, unless the file was changed by others
  std::vector<Entry> entries(std::int64_t plan);  // in their order without shuffling. Error(not_found)
  std::int64_t failures(std::int64_t plan);

  // False if it does not wait any more.
  bool begin(std::int64_t item, const std::string& run, const std::string& recording);
  // The run did not begin, for a reason that passes: the item waits again as if it had not been tried.
  void put_back(std::int64_t item, const std::string& run);
  // What became of the run, and of its item, which may wait again.
  void finish(std::int64_t item, const std::string& run, ItemState run_state, ItemState item_state,
              const std::string& reason, bool recorded);
  void confirm_plans();
  void set_up(std::int64_t plan, const nlohmann::json& values);

  struct Run {
    std::string run{}, recording{};
    ItemState state = ItemState::running;
    std::string reason{}, started{}, ended{};
    nlohmann::json figures{};  // null: not known yet
  };
  std::vector<Run> runs(std::int64_t item);
  void set_figures(const std::string& run, const nlohmann::json& figures);

  struct State {
    bool started = false;
    std::string reason{};  // why not
  };
  State state();
  void set_state(const State& state);

 private:
  static std::vector<Entry> read_entries(Database::Rows rows);
  std::vector<std::int64_t> chosen(ItemChoice which);
  void rank_anew();

  std::mutex mutex_;
  Database database_;
};

}  // namespace ferrobench::server
