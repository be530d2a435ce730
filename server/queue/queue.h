// Runs one after the other, over nights and restarts. The ledger says what is to be run and what has become
// of it; the queue's thread takes the first item that waits, marks it, starts its run, follows it to its end,
// and decides by the plan's rules whether the next one may begin.
//
// When it stops, it says why, and only queue.start goes on:
//
//   a person       queue.stop lets the run under way end; run.abort stops it and the queue with it
//   a rule         so many failures, a limit that tripped; an open interlock, an output not at zero
//   a restart      unless the plan says "resume": "automatic" and queue.start came after it was added
//   nothing left   the queue is empty
//
// A confirmation, a bench that others use, or a plan's condition (wait.h) is waited for. The ledger knows
// nothing of that: after a restart it is waited for anew.
//
// Locks: mutex_ is held for no disk and no bench, so that a stop waits for neither.
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "server/engine/engine.h"
#include "server/queue/hooks.h"
#include "server/queue/ledger.h"
#include "server/queue/summary.h"

namespace ferrobench::server {

enum class QueueActivity { stopped, running, asks, waits };
std::span<const std::pair<QueueActivity, std::string_view>> enum_names(QueueActivity);

struct QueueStatus {
  QueueActivity state = QueueActivity::stopped;
  std::string reason{};
  std::int64_t item = 0;
  std::string confirm{};
  bool operator==(const QueueStatus&) const = default;
};
template <class Visitor>
void describe(Visitor& visit, QueueStatus& s) {
  visit("state", s.state,
        {.required = true,
         .doc = "stopped; running; asks: a person must do and confirm something first; waits: for the bench, "
                "or for the condition that the reason says"});
  visit("reason", s.reason, {.doc = "why it is stopped, or what it waits for"});
  visit("item", s.item, {.min = 0, .doc = "that is running, or whose turn it is; 0: none"});
  visit("confirm", s.confirm, {.doc = "what a person must do, then queue.confirm; \"\": nothing"});
}

class Queue {
 public:
  // Touches no file before it is used; the engine must outlive it.
  explicit Queue(Engine& engine, std::unique_ptr<Hooks> hooks = nullptr)
      : engine_(engine), hooks_(std::move(hooks)) {}
  ~Queue() { end(); }
  Queue(const Queue&) = delete;
  Queue& operator=(const Queue&) = delete;

  // For a daemon, once it has taken runs over and recovered recordings: settles what a crash has left, and
  // goes on if it may. What was found, in a sentence; "" if nothing was. Error(io_error) for a damaged file.
  std::string open();
  // No run starts any more. To be called before the engine stops; end() waits for the run under way.
  void close();
  void end();

  // Everything that can be refused before the devices are asked is refused here: Error as run.start throws.
  Ledger::Added add(Plan plan);
  Ledger::Page list(std::int64_t plan, std::optional<ItemState> state, std::int64_t first,
                    std::int64_t count);
  std::int64_t move(ItemChoice which, std::optional<std::int64_t> before, bool first);
  std::int64_t remove(ItemChoice which);
  // Error(bad_state) if nothing waits, or no daemon has opened it.
  QueueStatus start();
  QueueStatus stop(const std::string& reason);
  // Somebody stops the bench. Waits for nothing. Whether the queue was not stopped already. `seen`: unless
  // something has changed since.
  bool halt(const std::string& reason, std::optional<std::uint64_t> seen = {});
  // Error(bad_state) if this item does not ask for it.
  QueueStatus confirm(std::int64_t item);
  QueueStatus status() const;
  PlanSummary summary(const SummaryRequest& request) { return summarize(request, ledger(), engine_.store()); }
  Ledger& ledger();

 private:
  using Lock = std::unique_lock<std::mutex>;
  struct Outcome {
    ItemState state{};
    std::string reason{};
    bool recorded = true;
    bool by_person = false, limit = false;
    std::string alarm{};  // why nothing more may run, whatever the rules say
  };
  static Outcome outcome_of(const RunStatus& run);
  Outcome outcome_of_recording(const std::string& run, const std::string& recording) const;
  void work();
  void keep_saved();
  void step(std::uint64_t seen);
  void run_item(const Ledger::Entry& next, std::uint64_t seen);
  bool wait_for_condition(const Ledger::Entry& next, std::uint64_t seen);
  std::optional<Error> start_run(RunRequest request, const std::string& path);
  bool passes(const Error& refused, std::int64_t item);
  static Outcome outcome_of(const Error& refused);
  RunStatus end_of(const std::string& run);
  void follow(const Ledger::Entry& entry, const std::string& run);
  void settle(const Ledger::Entry& entry, const std::string& run, const Outcome& outcome);
  void check(const Plan& plan) const;
  void wait(std::uint64_t seen, QueueStatus meanwhile, std::optional<std::chrono::milliseconds> most = {});
  void come_to_rest(const std::string& reason, HookEvent event = HookEvent::queue_stopped,
                    std::optional<std::uint64_t> seen = {});
  void tell(HookEvent event, const nlohmann::json& facts);
  void save();
  void show();
  void touch();

  Engine& engine_;
  std::unique_ptr<Hooks> hooks_;
  std::once_flag opened_;
  std::unique_ptr<Ledger> ledger_;
  std::mutex saving_;  // over the state in the ledger

  mutable std::mutex mutex_;  // over what follows
  std::condition_variable changed_;
  std::uint64_t version_ = 0;  // of all that the thread goes by
  bool started_ = false, unsaved_ = false, ending_ = false, ended_ = false;
  bool resumed_ = false;  // since a restart; nobody has said queue.start
  std::string reason_;
  QueueStatus doing_;                                                // while it is started
  std::optional<std::pair<Ledger::Entry, std::string>> taken_over_;  // with the id of its run
  std::thread thread_, saver_;
};

}  // namespace ferrobench::server
