#include "server/queue/queue.h"

#include "server/methods/methods.h"
#include "server/methods/recording_rows.h"
#include "server/queue/summary.h"
#include "server/rpc/schemas.h"

namespace ferrobench::server {
namespace {

struct QueueAdd {
  std::optional<PlannedRun> run{};
  std::optional<Plan> plan{};
};
template <class Visitor>
void describe(Visitor& visit, QueueAdd& p) {
  visit("run", p.run, {.doc = "a single run; or a plan:"});
  visit("plan", p.plan, {.doc = "a run over lists or ranges of its settings"});
}
struct QueueAdded {
  std::int64_t plan = 0, first = 0, count = 0;
};
template <class Visitor>
void describe(Visitor& visit, QueueAdded& a) {
  visit("plan", a.plan, {.required = true, .doc = "its id; a single run is a plan as well"});
  visit("first_item", a.first,
        {.required = true, .doc = "id of the first run in its order; the others follow"});
  visit("count", a.count, {.required = true, .doc = "how many runs"});
}

struct QueueListParams {
  std::int64_t first = 0, count = 100, plan = 0;
  std::optional<ItemState> state{};
};
template <class Visitor>
void describe(Visitor& visit, QueueListParams& p) {
  visit("first", p.first, {.min = 0, .max = 1e9, .doc = "how many to leave out at the beginning"});
  visit("count", p.count, {.min = 0, .max = 1000, .doc = "how many at most"});
  visit("plan", p.plan, {.min = 0, .doc = "of this plan alone; 0: of all"});
  visit("state", p.state, {.doc = "in this state alone; absent: in any"});
}
struct QueueListed {
  QueueStatus queue{};
  std::vector<QueueItem> items{};
  std::int64_t total = 0;
  ItemCounts counts{};
};
template <class Visitor>
void describe(Visitor& visit, QueueListed& l) {
  visit("queue", l.queue, {.required = true, .doc = "what it does"});
  visit("items", l.items, {.required = true, .doc = "in the order in which they run and have run"});
  visit("total", l.total, {.required = true, .doc = "how many there are of those asked for"});
  visit("counts", l.counts, {.required = true, .doc = "how many there are of all, by state"});
}

void describe_choice(auto& visit, ItemChoice& c) {
  visit("item", c.item, {.min = 0, .doc = "id of an item; or:"});
  visit("plan", c.plan, {.min = 0, .doc = "id of a plan, for all its items"});
}
struct MoveParams {
  ItemChoice which{};
  std::optional<std::int64_t> before{};
  bool first = false;
};
template <class Visitor>
void describe(Visitor& visit, MoveParams& p) {
  describe_choice(visit, p.which);
  visit("before", p.before, {.min = 1, .doc = "id of another item that waits; absent: to the end, unless"});
  visit("first", p.first, {.doc = "before all others that wait"});
}
struct RemoveParams {
  ItemChoice which{};
};
template <class Visitor>
void describe(Visitor& visit, RemoveParams& p) {
  describe_choice(visit, p.which);
}
struct ChangedItems {
  std::int64_t count = 0;
};
template <class Visitor>
void describe(Visitor& visit, ChangedItems& c) {
  visit("count", c.count, {.required = true, .doc = "how many items"});
}
struct ConfirmParams {
  std::int64_t item = 0;
};
template <class Visitor>
void describe(Visitor& visit, ConfirmParams& p) {
  visit("item", p.item, {.min = 1, .required = true, .doc = "id of the item that asks for it"});
}

ItemChoice one_of_them(const ItemChoice& which) {
  if ((which.item == 0) != (which.plan == 0)) return which;
  throw Error(ErrorCode::invalid_params, "an item or a plan is wanted",
              Problem{.path = "/item",
                      .message = which.item == 0 ? "is missing" : "is given beside a plan",
                      .hint = R"(give either "item" or "plan"; queue.list names them)"});
}

QueueAdded put_in_queue(const QueueAdd& p, Queue& queue) {
  if (p.run.has_value() == p.plan.has_value())
    throw Error(ErrorCode::invalid_params, "a run or a plan is wanted",
                Problem{.path = "/run",
                        .message = p.run ? "is given beside a plan" : "is missing",
                        .hint = R"(give either "run" or "plan")"});
  const auto added = [](const Ledger::Added& a) { return QueueAdded{a.plan, a.first, a.count}; };
  if (p.run) {
    Plan plan;
    plan.run = *p.run;
    demand_valid(plan);
    return added(queue.add(std::move(plan)));
  }
  demand_valid(*p.plan, "/plan");
  try {
    return added(queue.add(*p.plan));
  } catch (const Error& refused) {
    auto problems = refused.problems();
    for (auto& problem : problems) problem.path.insert(0, "/plan");
    throw Error(refused.code(), refused.message(), std::move(problems));
  }
}

nlohmann::json summary_schema() {
  using namespace schema;
  return object({{"title", text("of the plan")},
                 {"runs", table_schema()},
                 {"means", table_schema()},
                 {"known_figures", list_of(text(), "what can be asked for")},
                 {"content", text("the whole summary, in a format other than json")}});
}

const std::vector<ErrorCode> disk_errors{ErrorCode::io_error, ErrorCode::disk_full};
std::vector<ErrorCode> with_disk_errors(std::vector<ErrorCode> errors) {
  errors.insert(errors.end(), disk_errors.begin(), disk_errors.end());
  return errors;
}

}  // namespace

void add_queue_methods(Dispatcher& rpc, const std::shared_ptr<Queue>& queue) {
  rpc.add<QueueAdd>(
      {.name = "queue.add",
       .doc = "Puts a run or a plan at the end of the queue, and starts nothing. All its runs are checked "
              "against "
              "models and limits first.",
       .role = Role::control,
       .errors = with_disk_errors({ErrorCode::not_found, ErrorCode::bad_protocol, ErrorCode::bad_model,
                                   ErrorCode::limit_exceeded, ErrorCode::numerical})},
      [queue](const QueueAdd& p) { return put_in_queue(p, *queue); });
  rpc.add<QueueListParams>(
      {.name = "queue.list", .doc = "What the queue does, and a page of its items.", .errors = disk_errors},
      [queue](const QueueListParams& p) {
        auto page = queue->list(p.plan, p.state, p.first, p.count);
        return QueueListed{queue->status(), std::move(page.items), page.total, page.counts};
      });
  rpc.add<MoveParams>(
      {.name = "queue.move",
       .doc = "Moves what waits before another item, to the front or to the end.",
       .role = Role::control,
       .errors = with_disk_errors({ErrorCode::not_found, ErrorCode::bad_state, ErrorCode::limit_exceeded})},
      [queue](const MoveParams& p) {
        return ChangedItems{queue->move(one_of_them(p.which), p.before, p.first)};
      });
  rpc.add<RemoveParams>(
      {.name = "queue.remove",
       .doc = "Forgets items, whether they wait or are over. Their recordings stay.",
       .role = Role::control,
       .errors = with_disk_errors({ErrorCode::not_found, ErrorCode::busy})},
      [queue](const RemoveParams& p) { return ChangedItems{queue->remove(one_of_them(p.which))}; });
  rpc.add<NoParams>({.name = "queue.start",
                     .doc = "Runs what waits, one after the other. Plans that say so go on after a restart "
                            "of the daemon from now "
                            "on.",
                     .role = Role::control,
                     .errors = with_disk_errors({ErrorCode::bad_state})},
                    [queue](const NoParams&) { return queue->start(); });
  rpc.add<NoParams>(
      {.name = "queue.stop",
       .doc = "No further run begins; the one under way goes on, which run.abort stops, and the queue "
              "with it.",
       .role = Role::control,
       .errors = disk_errors},
      [queue](const NoParams&, CallContext& caller) { return queue->stop("stopped by " + caller.client); });
  rpc.add<SummaryRequest>({.name = "queue.summary",
                           .doc = "A plan's recordings at a glance: figures of their reports against what "
                                  "was swept, run by run and as "
                                  "means over the repeats.",
                           .lane = Lane::heavy,
                           .errors = with_disk_errors({ErrorCode::not_found}),
                           .result_schema = summary_schema()},
                          [queue](const SummaryRequest& p) { return render(queue->summary(p), p.format); });
  rpc.add<ConfirmParams>({.name = "queue.confirm",
                          .doc = "Says that what the queue asks for is done. The next run begins at once.",
                          .role = Role::control,
                          .errors = with_disk_errors({ErrorCode::not_found, ErrorCode::bad_state})},
                         [queue](const ConfirmParams& p) { return queue->confirm(p.item); });
}

}  // namespace ferrobench::server
