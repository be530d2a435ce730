#include "server/queue/ledger.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>

#include "recordings/format/iso_time.h"

namespace ferrobench::server {

using nlohmann::json;

namespace {

constexpr std::int64_t version = 1;           // of the tables
constexpr std::int64_t most_items = 100'000;  // some years of nights
// Between two items that were added one after the other: halved 32 times before all are ranked anew, and
// 2^31 items fit.
constexpr std::int64_t rank_step = std::int64_t{1} << 32;

// `number`: in the plan's order without shuffling. `rank`: the order of the queue. run, recording, runs: of
// the latest run, and how many there were.
constexpr auto tables = R"(
  CREATE TABLE queue (id INTEGER PRIMARY KEY CHECK (id = 1), started INTEGER NOT NULL, reason TEXT NOT NULL);
  INSERT INTO queue VALUES (1, 0, '');
  CREATE TABLE plans (id INTEGER PRIMARY KEY AUTOINCREMENT, name TEXT NOT NULL, document TEXT NOT NULL,
    added TEXT NOT NULL, confirmed INTEGER NOT NULL DEFAULT 0, set_up TEXT NOT NULL DEFAULT '{}');
  CREATE TABLE items (id INTEGER PRIMARY KEY AUTOINCREMENT, plan INTEGER NOT NULL REFERENCES plans ON DELETE CASCADE,
    number INTEGER NOT NULL, repeat INTEGER NOT NULL, step TEXT NOT NULL, rank INTEGER NOT NULL,
    state TEXT NOT NULL DEFAULT 'waiting', reason TEXT NOT NULL DEFAULT '', run TEXT NOT NULL DEFAULT '',
    recording TEXT NOT NULL DEFAULT '', runs INTEGER NOT NULL DEFAULT 0);
  CREATE INDEX items_by_rank ON items (rank);
  CREATE INDEX items_by_state ON items (state, rank);
  CREATE INDEX items_by_plan ON items (plan, rank);
  CREATE TABLE runs (id TEXT PRIMARY KEY, item INTEGER NOT NULL REFERENCES items ON DELETE CASCADE,
    recording TEXT NOT NULL, state TEXT NOT NULL DEFAULT 'running', reason TEXT NOT NULL DEFAULT '',
    started TEXT NOT NULL, ended TEXT NOT NULL DEFAULT '', figures TEXT NOT NULL DEFAULT 'null');
  CREATE INDEX runs_by_item ON runs (item);
  PRAGMA user_version = 1;
)";

constexpr std::string_view item_columns =
    "SELECT i.id, i.plan, p.name, i.step, i.repeat, i.state, i.reason, i.run, i.recording, i.runs, i.number, "
    "p.document, p.confirmed, p.set_up FROM items i JOIN plans p ON p.id = i.plan ";

std::string sql(std::string_view rest) {
  return std::string(item_columns).append(rest);
}

json parsed(const std::string& text) {
  return parse_json_text(text, ErrorCode::io_error, "the queue's file");
}

std::string name_of(ItemState state) {
  return write_json(state).get<std::string>();
}

ItemState state_of(const std::string& name) {
  return parse<ItemState>(name, ErrorCode::io_error, "the state of an item");
}

QueueItem item_of(const Database::Rows& row) {
  return {.item = row.whole(0),
          .plan = row.whole(1),
          .name = row.text(2),
          .values = parsed(row.text(3)),
          .repeat = row.whole(4),
          .state = state_of(row.text(5)),
          .reason = row.text(6),
          .run = row.text(7),
          .recording = row.text(8),
          .runs = row.whole(9)};
}

Error no_such(const char* what, std::int64_t id) {
  return {ErrorCode::not_found, std::string("there is no such ") + what + " in the queue",
          Problem{.path = std::string("/") + what,
                  .message = "is not known here",
                  .given = id,
                  .hint = "queue.list names them"}};
}

}  // namespace

std::span<const std::pair<ItemState, std::string_view>> enum_names(ItemState) {
  static constexpr std::array<std::pair<ItemState, std::string_view>, 6> names{
      {{ItemState::waiting, "waiting"},
       {ItemState::running, "running"},
       {ItemState::complete, "complete"},
       {ItemState::aborted, "aborted"},
       {ItemState::failed, "failed"},
       {ItemState::broken_off, "broken_off"}}};
  return names;
}

Ledger::Ledger(const std::filesystem::path& folder)
    : database_((std::filesystem::canonical(folder) / "queue.db").string()) {
  Database::Transaction all(database_);
  std::int64_t found = 0;
  if (auto row = database_.query("PRAGMA user_version"); row.next()) found = row.whole(0);
  if (found == 0)
    database_.execute(tables);
  else if (found != version)
    throw Error(
        ErrorCode::io_error, "the queue's file is of another version of ferrobench",
        Problem{.given = found, .allowed = version, .hint = "move queue.db away, or use that version"});
  all.commit();
}

Ledger::Added Ledger::add(const Plan& plan) {
  const auto steps = steps_of(plan);
  const auto count = static_cast<std::int64_t>(steps.size());
  const std::scoped_lock lock(mutex_);
  Database::Transaction all(database_);
  std::int64_t rank = 0;
  if (auto row = database_.query("SELECT count(*), coalesce(max(rank), 0) FROM items"); row.next()) {
    rank = row.whole(1);
    if (row.whole(0) + count > most_items)
      throw Error(ErrorCode::limit_exceeded, "the queue is full",
                  Problem{.given = row.whole(0) + count,
                          .allowed = {{"to", most_items}},
                          .unit = "runs",
                          .hint = "queue.remove what is over"});
  }
  if (rank > std::numeric_limits<std::int64_t>::max() - (count + 1) * rank_step) {
    rank_anew();
    rank = most_items * rank_step;
  }
  database_.change("INSERT INTO plans (name, document, added) VALUES (?, ?, ?)", plan.name,
                   write_json(plan).dump(), recordings::iso_now());
  Added out{.plan = database_.last_id(), .count = count};
  for (const auto& step : steps) {
    auto values = json::object();
    for (std::size_t i = 0; i < plan.sweeps.size(); ++i) values[plan.sweeps[i].set] = step.values[i];
    rank += rank_step;
    database_.change("INSERT INTO items (plan, number, repeat, step, rank) VALUES (?, ?, ?, ?, ?)", out.plan,
                     step.number, step.repeat, values.dump(), rank);
    if (out.first == 0) out.first = database_.last_id();
  }
  all.commit();
  return out;
}

Ledger::Page Ledger::list(std::int64_t plan, std::optional<ItemState> state, std::int64_t first,
                          std::int64_t count) {
  const std::scoped_lock lock(mutex_);
  Page out;
  const std::string wanted = state ? name_of(*state) : "";
  const auto read = [&](Database::Rows rows) {
    while (rows.next()) out.items.push_back(item_of(rows));
  };
  const auto count_of = [](Database::Rows rows) { return rows.next() ? rows.whole(0) : 0; };
  static const std::string all = sql("ORDER BY i.rank LIMIT ? OFFSET ?"),
                           of_plan = sql("WHERE i.plan = ? ORDER BY i.rank LIMIT ? OFFSET ?"),
                           in_state = sql("WHERE i.state = ? ORDER BY i.rank LIMIT ? OFFSET ?"),
                           both = sql("WHERE i.plan = ? AND i.state = ? ORDER BY i.rank LIMIT ? OFFSET ?");
  if (plan == 0 && !state) {
    read(database_.query(all, count, first));
    out.total = count_of(database_.query("SELECT count(*) FROM items"));
  } else if (!state) {
    read(database_.query(of_plan, plan, count, first));
    out.total = count_of(database_.query("SELECT count(*) FROM items WHERE plan = ?", plan));
  } else if (plan == 0) {
    read(database_.query(in_state, wanted, count, first));
    out.total = count_of(database_.query("SELECT count(*) FROM items WHERE state = ?", wanted));
  } else {
    read(database_.query(both, plan, wanted, count, first));
    out.total =
        count_of(database_.query("SELECT count(*) FROM items WHERE plan = ? AND state = ?", plan, wanted));
  }
  json counts = json::object();
  for (auto rows = database_.query("SELECT state, count(*) FROM items GROUP BY state"); rows.next();)
    counts[rows.text(0)] = rows.whole(1);
  out.counts = parse<ItemCounts>(counts, ErrorCode::io_error, "the queue's file");
  return out;
}

std::vector<std::int64_t> Ledger::chosen(ItemChoice which) {
  std::vector<std::int64_t> out;
  const auto read = [&](Database::Rows rows) {
    while (rows.next()) out.push_back(rows.whole(0));
  };
  if (which.item != 0)
    read(database_.query("SELECT id FROM items WHERE id = ?", which.item));
  else
    read(database_.query("SELECT id FROM items WHERE plan = ? ORDER BY rank", which.plan));
  if (out.empty()) throw which.item != 0 ? no_such("item", which.item) : no_such("plan", which.plan);
  return out;
}

// As far apart as those that were added one after the other.
void Ledger::rank_anew() {
  database_.execute("UPDATE items SET rank = r.place * " + std::to_string(rank_step) +
                    " FROM (SELECT id, row_number() OVER (ORDER BY rank, id) AS place FROM items) AS r WHERE "
                    "items.id = r.id");
}

std::int64_t Ledger::move(ItemChoice which, std::optional<std::int64_t> before, bool first) {
  const std::scoped_lock lock(mutex_);
  Database::Transaction all(database_);
  auto ids = chosen(which);
  const auto state_of_item = [this](std::int64_t id) {
    auto row = database_.query("SELECT state FROM items WHERE id = ?", id);
    if (!row.next()) throw no_such("before", id);
    return row.text(0);
  };
  std::erase_if(ids, [&](std::int64_t id) { return state_of_item(id) != "waiting"; });
  if (ids.empty())
    throw Error(ErrorCode::bad_state, "only what waits can be moved",
                Problem{.path = which.item != 0 ? "/item" : "/plan",
                        .message = "does not wait",
                        .given = which.item != 0 ? which.item : which.plan});
  if (before && (state_of_item(*before) != "waiting" || std::ranges::count(ids, *before) > 0))
    throw Error(ErrorCode::bad_state, "nothing can be put before this item",
                Problem{.path = "/before", .message = "does not wait, or moves itself", .given = *before});
  // The neighbours between which they go: those that wait and do not move.
  const json moved(ids);
  const std::string others =
      " FROM items WHERE state = 'waiting' AND id NOT IN (SELECT value FROM json_each(?)) ";
  const auto place = [&]() -> std::optional<std::pair<std::int64_t, std::int64_t>> {
    std::optional<std::int64_t> above, below;
    if (before) {
      if (auto row = database_.query("SELECT rank FROM items WHERE id = ?", *before); row.next())
        above = row.whole(0);
    } else if (first) {
      if (auto row = database_.query("SELECT min(rank), count(*)" + others, moved.dump());
          row.next() && row.whole(1) > 0)
        above = row.whole(0);
    }
    if (!above) {
      auto row = database_.query("SELECT coalesce(max(rank), 0) FROM items");
      row.next();
      return std::pair{row.whole(0), rank_step};
    }
    if (auto row =
            database_.query("SELECT max(rank), count(*)" + others + "AND rank < ?", moved.dump(), *above);
        row.next() && row.whole(1) > 0)
      below = row.whole(0);
    // What is over comes before all that waits; there may be nothing at all.
    if (!below) {
      auto row = database_.query("SELECT coalesce(max(rank), ? - 2 * ?) FROM items WHERE rank < ?", *above,
                                 (static_cast<std::int64_t>(ids.size()) + 1) * rank_step, *above);
      row.next();
      below = row.whole(0);
    }
    const auto step = (*above - *below) / (static_cast<std::int64_t>(ids.size()) + 1);
    if (step == 0) return std::nullopt;
    return std::pair{*below, step};
  };
  auto where = place();
  if (!where) {
    rank_anew();
    where = place();
  }
  if (!where) throw Error(ErrorCode::limit_exceeded, "there is no room between these items");
  auto rank = where->first;
  for (const auto id : ids) {
    rank += where->second;
    database_.change("UPDATE items SET rank = ? WHERE id = ?", rank, id);
  }
  all.commit();
  return static_cast<std::int64_t>(ids.size());
}

std::int64_t Ledger::remove(ItemChoice which) {
  const std::scoped_lock lock(mutex_);
  Database::Transaction all(database_);
  const auto ids = chosen(which);
  const json removed(ids);
  if (auto row = database_.query("SELECT id FROM items WHERE state = 'running' AND id IN (SELECT value FROM "
                                 "json_each(?))",
                                 removed.dump());
      row.next())
    throw Error(ErrorCode::busy, "a run of this item is under way",
                Problem{.path = which.item != 0 ? "/item" : "/plan",
                        .message = "is running",
                        .given = row.whole(0),
                        .hint = "wait for its end, or run.abort it"});
  database_.change("DELETE FROM items WHERE id IN (SELECT value FROM json_each(?))", removed.dump());
  database_.change("DELETE FROM plans WHERE NOT EXISTS (SELECT 1 FROM items WHERE items.plan = plans.id)");
  all.commit();
  return static_cast<std::int64_t>(ids.size());
}

std::vector<Ledger::Entry> Ledger::read_entries(Database::Rows rows) {
  std::vector<Entry> out;
  std::map<std::int64_t, std::shared_ptr<const Plan>> plans;
  while (rows.next()) {
    Entry entry{.item = item_of(rows), .confirmed = rows.whole(12) != 0, .set_up = parsed(rows.text(13))};
    auto& plan = plans[entry.item.plan];
    if (!plan)
      plan = std::make_shared<const Plan>(
          parse<Plan>(parsed(rows.text(11)), ErrorCode::io_error, "a plan in the queue's file"));
    entry.plan = plan;
    entry.step = {.values = {}, .repeat = entry.item.repeat, .number = rows.whole(10)};
    for (const auto& sweep : plan->sweeps)
      entry.step.values.push_back(entry.item.values.value(sweep.set, json()));
    out.push_back(std::move(entry));
  }
  return out;
}

std::optional<Ledger::Entry> Ledger::next() {
  static const std::string text = sql("WHERE i.state = 'waiting' ORDER BY i.rank LIMIT 1");
  const std::scoped_lock lock(mutex_);
  auto found = read_entries(database_.query(text));
  if (found.empty()) return std::nullopt;
  return std::move(found.front());
}

Ledger::Entry Ledger::entry(std::int64_t item) {
  static const std::string text = sql("WHERE i.id = ?");
  const std::scoped_lock lock(mutex_);
  auto found = read_entries(database_.query(text, item));
  if (found.empty()) throw no_such("item", item);
  return std::move(found.front());
}

std::vector<Ledger::Entry> Ledger::running() {
  static const std::string text = sql("WHERE i.state = 'running' ORDER BY i.rank");
  const std::scoped_lock lock(mutex_);
  return read_entries(database_.query(text));
}

std::vector<Ledger::Entry> Ledger::entries(std::int64_t plan) {
  static const std::string text = sql("WHERE i.plan = ? ORDER BY i.number");
  const std::scoped_lock lock(mutex_);
  auto found = read_entries(database_.query(text, plan));
  if (found.empty()) throw no_such("plan", plan);
  return found;
}

std::int64_t Ledger::failures(std::int64_t plan) {
  const std::scoped_lock lock(mutex_);
  auto row = database_.query("SELECT count(*) FROM items WHERE plan = ? AND state = 'failed'", plan);
  return row.next() ? row.whole(0) : 0;
}

bool Ledger::begin(std::int64_t item, const std::string& run, const std::string& recording) {
  const std::scoped_lock lock(mutex_);
  Database::Transaction all(database_);
  if (database_.change("UPDATE items SET state = 'running', reason = '', run = ?, recording = ?, "
                       "runs = runs + 1 WHERE id = ? AND state = 'waiting'",
                       run, recording, item) == 0)
    return false;
  database_.change("INSERT INTO runs (id, item, recording, started) VALUES (?, ?, ?, ?)", run, item,
                   recording, recordings::iso_now());
  all.commit();
  return true;
}

void Ledger::put_back(std::int64_t item, const std::string& run) {
  const std::scoped_lock lock(mutex_);
  Database::Transaction all(database_);
  database_.change("DELETE FROM runs WHERE id = ?", run);
  database_.change(
      "UPDATE items SET state = 'waiting', runs = runs - 1, "
      "run = coalesce((SELECT id FROM runs WHERE item = items.id ORDER BY rowid DESC LIMIT 1), ''), "
      "recording = coalesce((SELECT recording FROM runs WHERE item = items.id ORDER BY rowid DESC LIMIT 1), "
      "'') "
      "WHERE id = ?",
      item);
  all.commit();
}

void Ledger::finish(std::int64_t item, const std::string& run, ItemState run_state, ItemState item_state,
                    const std::string& reason, bool recorded) {
  const std::scoped_lock lock(mutex_);
  Database::Transaction all(database_);
  database_.change("UPDATE runs SET state = ?, reason = ?, ended = ? WHERE id = ?", name_of(run_state),
                   reason, recordings::iso_now(), run);
  database_.change("UPDATE items SET state = ?, reason = ? WHERE id = ?", name_of(item_state), reason, item);
  if (!recorded) {
    database_.change("UPDATE runs SET recording = '' WHERE id = ?", run);
    database_.change("UPDATE items SET recording = '' WHERE id = ?", item);
  }
  all.commit();
}

void Ledger::confirm_plans() {
  const std::scoped_lock lock(mutex_);
  database_.change("UPDATE plans SET confirmed = 1 WHERE confirmed = 0");
}

// What one plan's operator has set up, another one's may have undone.
void Ledger::set_up(std::int64_t plan, const json& values) {
  const std::scoped_lock lock(mutex_);
  database_.change(
      "UPDATE plans SET set_up = CASE id WHEN ? THEN ? ELSE '{}' END WHERE id = ? OR set_up <> '{}'", plan,
      values.dump(), plan);
}

std::vector<Ledger::Run> Ledger::runs(std::int64_t item) {
  const std::scoped_lock lock(mutex_);
  std::vector<Run> out;
  for (auto rows = database_.query("SELECT id, recording, state, reason, started, ended, figures FROM runs "
                                   "WHERE item = ? ORDER BY rowid",
                                   item);
       rows.next();)
    out.push_back({.run = rows.text(0),
                   .recording = rows.text(1),
                   .state = state_of(rows.text(2)),
                   .reason = rows.text(3),
                   .started = rows.text(4),
                   .ended = rows.text(5),
                   .figures = parsed(rows.text(6))});
  return out;
}

void Ledger::set_figures(const std::string& run, const json& figures) {
  const std::scoped_lock lock(mutex_);
  database_.change("UPDATE runs SET figures = ? WHERE id = ?", figures.dump(), run);
}

Ledger::State Ledger::state() {
  const std::scoped_lock lock(mutex_);
  auto row = database_.query("SELECT started, reason FROM queue");
  if (!row.next()) return {};
  return {.started = row.whole(0) != 0, .reason = row.text(1)};
}

void Ledger::set_state(const State& state) {
  const std::scoped_lock lock(mutex_);
  database_.change("UPDATE queue SET started = ?, reason = ?", std::int64_t{state.started}, state.reason);
}

}  // namespace ferrobench::server
