// The judge: what was asked and told, replayed against a model of what a bench may do.
#include <algorithm>
#include <limits>
#include <set>

#include "tests/server/run_states.h"

namespace ferrobench::server::states {

namespace {

using State = RunState;
using Failures = std::vector<std::string>;

std::string name(State state) {
  return write_json(state).get<std::string>();
}

// As run.h has it.
const std::map<State, std::set<State>>& followers() {
  static const std::map<State, std::set<State>> all{
      {State::arming, {State::running, State::stopping, State::aborted}},
      {State::running, {State::pausing, State::stopping, State::complete, State::aborted}},
      {State::pausing, {State::paused, State::running, State::stopping, State::aborted}},
      {State::paused, {State::running, State::stopping, State::aborted}},
      {State::stopping, {State::aborted}},
      {State::complete, {}},
      {State::aborted, {}}};
  return all;
}

// Also where states in between were over before anybody looked.
bool may_follow(State from, State to) {
  std::set<State> reached;
  std::vector<State> open{from};
  while (!open.empty()) {
    const auto here = open.back();
    open.pop_back();
    for (const auto next : followers().at(here))
      if (reached.insert(next).second) open.push_back(next);
  }
  return from == to || reached.contains(to);
}

bool waits(State state) {
  return state == State::pausing || state == State::paused;
}

struct Interval {
  double begin = std::numeric_limits<double>::infinity(), end = -begin;
  bool contains(const Ask& ask) const { return begin < ask.begin && ask.end < end; }
  bool meets(const Ask& ask) const { return begin <= ask.end && ask.begin <= end; }
};

// One run in the eyes of all.
struct Trace {
  std::vector<State> states;               // as told, each once
  int pauses = 0, resumes = 0, stops = 0;  // that may have reached it
  Interval possible{}, sure{};             // when it was, or may have been, under way
};

using Traces = std::map<std::string, Trace>;

bool starts(const Ask& ask) {
  return ask.method == "run.start" || ask.method == "replay.start";
}

// The states of each run in the order told, and runs one after the other.
Traces follow(const std::vector<Told>& told, Figures& figures) {
  Traces traces;
  const Told* before = nullptr;
  for (const auto& now : told) {
    const auto& run = now.status;
    const auto fail = [&](const std::string& what) {
      figures.failures.push_back(run.run + " " + name(run.state) + ": " + what);
    };
    auto& trace = traces[run.run];
    const bool first = trace.states.empty();
    if (first) {
      if (run.state != State::arming) fail("is the first that is told of it");
      if (before != nullptr && !is_over(before->status.state))
        fail("while " + before->status.run + " goes on");
    } else {
      if (before->status.run != run.run) fail("though another run has begun");
      const auto from = trace.states.back();
      if (!may_follow(from, run.state)) fail("after " + name(from));
      if (from != run.state) ++figures.transitions[name(from) + " -> " + name(run.state)];
    }
    if (first || trace.states.back() != run.state) trace.states.push_back(run.state);
    trace.possible.end = now.time;
    if (is_over(run.state)) {
      if (!run.output_at_zero) fail("the output is not at zero");
      if (run.rows_on_disk != run.rows) fail("rows are missing on the disk");
      if (run.state == State::complete && run.progress != 1) fail("is not all of it");
      if ((run.state == State::aborted) != !run.reason.empty()) fail("reason \"" + run.reason + "\"");
      if (run.ended.empty()) fail("has no end");
    } else if (run.output_at_zero) {
      fail("the output is said to be at zero");
    }
    before = &now;
  }
  for (const auto& [id, trace] : traces)
    if (!is_over(trace.states.back())) figures.failures.push_back(id + " never ended");
  figures.runs = traces.size();
  return traces;
}

void find_intervals(const std::vector<Ask>& asks, Traces& traces, Failures& failures) {
  std::map<std::string, std::pair<std::string, nlohmann::json>> keys;
  for (const auto& ask : asks) {
    if (!ask.result.is_object() || !ask.result.contains("run")) continue;
    RunStatus status;
    std::vector<Problem> problems;
    read_json(ask.result, status, "", problems);
    if (status.run.empty()) continue;
    const auto found = traces.find(status.run);
    // A start that was refused after all was being prepared meanwhile.
    if (found == traces.end() && status.state == State::arming && !starts(ask)) continue;
    if (found == traces.end()) {
      failures.push_back(ask.method + " told of a run that nobody was told of: " + status.run);
      continue;
    }
    auto& [id, trace] = *found;
    if (starts(ask)) trace.possible.begin = std::min(trace.possible.begin, ask.begin);
    if (ask.method == "run.abort" && status.state == State::arming && trace.states.back() != State::aborted)
      failures.push_back(id + " went on though it was stopped before it moved");
    if (!is_over(status.state)) {
      trace.sure.begin = std::min(trace.sure.begin, ask.end);
      trace.sure.end = std::max(trace.sure.end, ask.begin);
    }
    if (const auto key = ask.params.value("idempotency_key", ""); !key.empty()) {
      const auto& [run, params] = keys.try_emplace(key, status.run, ask.params).first->second;
      if (run != status.run || params != ask.params) failures.push_back("the key " + key + " has two runs");
    }
  }
}

// What was asked of a run must have been asked for.
void justify(const std::vector<Ask>& asks, Traces& traces, Failures& failures) {
  for (const auto& ask : asks) {
    if (!ask.error.empty()) continue;
    if (ask.method == bench_death) {
      // It is noticed a little later, when the next run may have begun.
      constexpr double late = 1;  // s
      for (auto& [id, trace] : traces)
        trace.stops += trace.possible.begin <= ask.end + late && ask.begin <= trace.possible.end ? 1 : 0;
      continue;
    }
    const bool stop = ask.method == "run.abort" || ask.method == "job.cancel";
    if (!stop && ask.method != "run.pause" && ask.method != "run.resume") continue;
    const auto given = ask.params.value(ask.method == "job.cancel" ? "job" : "run", "");
    for (auto& [id, trace] : traces) {
      if (given.empty() ? !trace.possible.meets(ask) : given != id) continue;
      ++(stop ? trace.stops : ask.method == "run.pause" ? trace.pauses : trace.resumes);
    }
  }
  for (const auto& [id, trace] : traces) {
    int paused = 0, resumed = 0;
    for (std::size_t i = 1; i < trace.states.size(); ++i) {
      const auto from = trace.states[i - 1], to = trace.states[i];
      paused += !waits(from) && waits(to) ? 1 : 0;
      resumed += waits(from) && (to == State::running || to == State::complete) ? 1 : 0;
    }
    if (paused > trace.pauses) failures.push_back(id + " paused and nobody asked");
    if (resumed > trace.resumes) failures.push_back(id + " went on and nobody asked");
    if (trace.states.back() == State::aborted && trace.stops == 0)
      failures.push_back(id + " was aborted and nobody asked");
  }
}

const std::set<std::string>& errors_of(const std::string& method) {
  static const std::map<std::string, std::set<std::string>> all{
      {"run.start", {"not_controller", "busy", "invalid_params", "limit_exceeded", "not_found"}},
      {"replay.start", {"not_controller", "busy", "invalid_params", "not_found", "bad_recording"}},
      {"run.pause", {"not_controller", "bad_state", "not_found"}},
      {"run.resume", {"not_controller", "bad_state", "not_found"}},
      {"run.abort", {"bad_state", "not_found"}},
      {"job.cancel", {"not_controller", "bad_state", "not_found"}},
      {"run.status", {"not_found"}},
      {"job.status", {"not_found"}},
      {"run.list", {}},
      {"limits.get", {}},
      {"limits.set", {"not_controller", "busy", "invalid_params"}},
      {"lease.acquire", {"not_controller"}},
      {"lease.renew", {"not_controller"}},
      {"lease.release", {"not_controller"}},
      {"lease.status", {}},
      {"device.open", {"not_controller"}},
      {"device.close", {"not_controller", "busy", "not_found"}},
      {"device.info", {"busy", "not_found"}}};
  return all.at(method);
}

// Asks something of the bench that it may not live to answer.
bool uses_device(const std::string& method) {
  static const std::set<std::string> all{"run.start",   "run.pause",    "run.resume",
                                         "device.open", "device.close", "device.info"};
  return all.contains(method);
}

std::string text(const Ask& ask) {
  return ask.method + " " + ask.params.dump() + " by client " + std::to_string(ask.client) + " at " +
         std::to_string(ask.begin) + " s: " + (ask.error.empty() ? "no error" : ask.error);
}

// Errors that the method has, and one run at a time.
void judge_answers(const std::vector<Ask>& asks, const Traces& traces, Figures& figures) {
  const bool deaths = std::ranges::any_of(asks, [](const Ask& ask) { return ask.method == bench_death; });
  std::vector<const Ask*> refused;  // these had the bench, too, until they were
  for (const auto& ask : asks)
    if (starts(ask) && !ask.error.empty()) refused.push_back(&ask);
  for (const auto& ask : asks) {
    const auto fail = [&](const std::string& what) { figures.failures.push_back(text(ask) + ": " + what); };
    ++figures.answers[ask.method + (ask.error.empty() ? "" : " " + ask.error)];
    if (ask.method == bench_death) continue;
    const bool died = deaths && uses_device(ask.method) &&
                      (ask.error == "device_lost" || ask.error == "device_unavailable");
    if (!ask.error.empty() && !died && !errors_of(ask.method).contains(ask.error))
      fail("is no error of this method");
    if (ask.method == "run.list" &&
        std::ranges::count_if(ask.result.at("runs"),
                              [](const nlohmann::json& run) { return run.at("ended") == ""; }) > 1)
      fail("two runs at a time");

    const bool alone = starts(ask) || ask.method == "limits.set";
    if (!alone && ask.method != "device.close" && ask.method != "device.info") continue;
    bool under_way = false;
    for (const auto& [id, trace] : traces) {
      under_way = under_way || trace.possible.meets(ask);
      if (alone && ask.error.empty() && trace.sure.contains(ask) && ask.result.value("run", "") != id &&
          !ask.params.contains("idempotency_key"))
        fail("while " + id + " is under way");
    }
    under_way = under_way || std::ranges::any_of(refused, [&](const Ask* other) {
                  return other != &ask && other->begin <= ask.end && ask.begin <= other->end;
                });
    if (ask.error == "busy" && !under_way) fail("no run was under way");
  }
}

// Each client's own questions are in order.
void judge_order(const std::vector<Ask>& asks, Failures& failures) {
  std::map<std::pair<int, std::string>, State> last;
  for (const auto& ask : asks) {
    if (!ask.result.is_object() || !ask.result.contains("run") || ask.result.at("run") == "") continue;
    RunStatus status;
    std::vector<Problem> problems;
    read_json(ask.result, status, "", problems);
    const auto [at, fresh] = last.try_emplace({ask.client, status.run}, status.state);
    if (!may_follow(at->second, status.state)) failures.push_back(text(ask) + ": after " + name(at->second));
    at->second = status.state;
  }
}

// A stretch of time in which somebody may have held the lease (possible), and surely did.
struct Hold {
  std::string lease;
  Interval possible, sure;
};

std::vector<Hold> holds(const std::vector<Ask>& asks) {
  std::map<std::string, std::vector<const Ask*>> by_lease;
  for (const auto& ask : asks) {
    if (!ask.error.empty()) continue;
    if (ask.method == "lease.acquire" || ask.method == "lease.renew")
      by_lease[ask.result.at("lease")].push_back(&ask);
    if (ask.method == "lease.release") by_lease[ask.lease].push_back(&ask);
  }
  std::vector<Hold> out;
  for (auto& [lease, changes] : by_lease) {
    std::ranges::sort(changes, {}, [](const Ask* ask) { return ask->begin; });
    double released_from = std::numeric_limits<double>::infinity(), released_by = released_from;
    for (const auto* ask : changes)
      if (ask->method == "lease.release") released_from = ask->begin, released_by = ask->end;
    for (const auto* ask : changes) {
      if (ask->method == "lease.release") continue;
      constexpr double rounding = 1e-3;  // s; durations are whole ms
      const double seconds = ask->params.at("duration_s");
      // A later renewal may have made it end earlier than this one said.
      double until = ask->begin + seconds - rounding;
      for (const auto* other : changes)
        if (other->method != "lease.release" && other->end > ask->begin)
          until = std::min(until, other->begin + other->params.at("duration_s").get<double>() - rounding);
      out.push_back({lease,
                     {.begin = ask->begin, .end = std::min(ask->end + seconds + rounding, released_by)},
                     {.begin = ask->end, .end = std::min(until, released_from)}});
    }
  }
  return out;
}

void judge_lease(const std::vector<Ask>& asks, Failures& failures) {
  static const std::set<std::string> for_all{
      "run.status", "job.status",   "run.list",    "limits.get",
      "run.abort",  "lease.status", "device.info", std::string(bench_death)};
  const auto all = holds(asks);
  for (const auto& ask : asks) {
    if (for_all.contains(ask.method)) continue;
    const bool refused = ask.error == "not_controller";
    const auto given = ask.params.value("lease", ask.lease);
    const bool own = ask.method == "lease.renew" || ask.method == "lease.release";
    bool others = false, mine = false;
    for (const auto& hold : all) {
      if (hold.lease == given) {
        mine = mine || hold.sure.contains(ask);
      } else if (hold.sure.contains(ask) && !refused) {
        failures.push_back(text(ask) + ": while another client had the lease");
      }
      others = others || (hold.lease != given && hold.possible.meets(ask));
    }
    if (refused && (mine || (!own && !others))) failures.push_back(text(ask) + ": nobody else had the lease");
  }
}

}  // namespace

void judge(const std::vector<Ask>& asks, const std::vector<Told>& told, Figures& figures) {
  auto traces = follow(told, figures);
  find_intervals(asks, traces, figures.failures);
  justify(asks, traces, figures.failures);
  judge_answers(asks, traces, figures);
  judge_order(asks, figures.failures);
  judge_lease(asks, figures.failures);
}

std::ostream& operator<<(std::ostream& out, const Figures& figures) {
  out << figures.steps << " steps, " << figures.runs << " runs\n";
  for (const auto& [what, count] : figures.transitions) out << "  " << what << ": " << count << "\n";
  for (const auto& [what, count] : figures.answers) out << "  " << what << ": " << count << "\n";
  for (const auto& failure : figures.failures) out << "FAILED " << failure << "\n";
  return out << figures.failures.size() << " failures\n";
}

}  // namespace ferrobench::server::states
