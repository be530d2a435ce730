// A plan: a run over lists or ranges of its settings, as its author wrote it, and the runs that it stands
// for. A single run is a plan that sweeps nothing.
//
//     { "format": "ferrobench-plan", "version": 1, "name": "night",
//       "run": {"protocol": "full-loops", "fast": true, "set": {"sample_rate_Hz": 100}},   as for run.start
//       "sweeps": [
//         {"set": "prestress_MPa", "values": [2, 4, 8], "confirm": "set the prestress to {} MPa"},
//         {"set": "rate", "from": 0.1, "to": 10, "count": 5, "spacing": "logarithmic"}],
//       "repeats": 2, "shuffle": true, "seed": 7,
//       "wait": {"channel": "force", "value": 98, "tolerance": 2, "unit": "N", "for_s": 10},   see wait.h
//       "resume": "automatic", "repeat_broken": 3, "stop_after_failures": 1, "stop_on_limit": true }
//
// Order: what an operator confirms is outermost, so that it changes as seldom as it can; within, all other
// combinations once, then once more for each repeat; the first sweep changes slowest. `shuffle` draws the
// runs between two confirmations, repeats included, in an order of the seed.
#pragma once

#include <string>
#include <vector>

#include "base/fields.h"
#include "server/engine/request.h"
#include "server/queue/wait.h"

namespace ferrobench::server {

inline constexpr std::size_t most_planned_runs = 10'000;

enum class Spacing { linear, logarithmic };
std::span<const std::pair<Spacing, std::string_view>> enum_names(Spacing);

struct Sweep {
  std::string set{};
  std::optional<std::vector<nlohmann::json>> values{};
  std::optional<double> from{}, to{};
  std::int64_t count = 2;
  Spacing spacing = Spacing::linear;
  std::string confirm{};
};
template <class Visitor>
void describe(Visitor& visit, Sweep& s) {
  visit("set", s.set, {.required = true, .doc = "a setting, as in \"set\" of run.start"});
  visit("values", s.values, {.doc = "one after the other: numbers, texts, true or false; or a range:"});
  visit("from", s.from, {.doc = "first value of a range"});
  visit("to", s.to, {.doc = "its last value"});
  visit("count", s.count, {.min = 2, .max = most_planned_runs, .doc = "how many values the range has"});
  visit("spacing", s.spacing, {.doc = "equal steps, or equal ratios"});
  visit("confirm", s.confirm,
        {.doc = "what a person must do and confirm before a run with another value begins; {} is the value"});
}

// The part of run.start that a plan has; each of its runs has an id of its own.
struct PlannedRun {
  RunRequest request{};
};
template <class Visitor>
void describe(Visitor& visit, PlannedRun& r) {
  visit("protocol", r.request.protocol,
        {.doc = "name of a protocol, or a protocol; none for a replay. It is kept as it is now"});
  visit("device", r.request.device, {.doc = "as for run.start"});
  visit("config", r.request.config, {.doc = "as for run.start"});
  visit("model", r.request.model,
        {.doc = "name of a model, or a model; for the virtual device. Kept as it is now"});
  visit("fast", r.request.fast, {.doc = "as for run.start"});
  visit("seed", r.request.seed,
        {.min = 0, .doc = "virtual device: of the noise of the first run; each further one has the next"});
  visit("set", r.request.set, {.doc = "as for run.start"});
  visit("notes", r.request.notes, {.doc = "kept in each recording"});
}

enum class Resume { by_operator, automatic };
std::span<const std::pair<Resume, std::string_view>> enum_names(Resume);

// When the queue goes on, and when not.
struct Rules {
  Resume resume = Resume::by_operator;
  std::int64_t repeat_broken = 0;
  std::int64_t stop_after_failures = 1;
  bool stop_on_limit = true;
};
template <class Visitor>
void describe(Visitor& visit, Rules& r) {
  visit(
      "resume", r.resume,
      {.doc =
           "after a restart of the daemon: operator, the queue waits for queue.start; automatic, it goes on "
           "if queue.start was called since the plan was added"});
  visit("repeat_broken", r.repeat_broken,
        {.min = 0,
         .max = 1000,
         .doc = "how often a run is repeated that broke off as a process or the machine died"});
  visit("stop_after_failures", r.stop_after_failures,
        {.min = 0, .max = 1e6, .doc = "the queue stops after so many failed runs of the plan; 0: never"});
  visit("stop_on_limit", r.stop_on_limit, {.doc = "the queue stops when a limit trips"});
}

struct Plan {
  std::string format = "ferrobench-plan";
  std::int64_t version = 1;
  std::string name{};
  PlannedRun run{};
  std::vector<Sweep> sweeps{};
  std::int64_t repeats = 1;
  bool shuffle = false;
  std::int64_t seed = 1;
  std::optional<Wait> wait{};
  Rules rules{};
};
template <class Visitor>
void describe(Visitor& visit, Plan& p) {
  visit("format", p.format, {.doc = "ferrobench-plan"});
  visit("version", p.version, {.min = 1, .max = 1});
  visit("name", p.name, {.doc = "\"\": that of the protocol"});
  visit("run", p.run, {.required = true, .doc = "what all runs have in common"});
  visit("sweeps", p.sweeps, {.doc = "none: a single run"});
  visit("repeats", p.repeats, {.min = 1, .max = most_planned_runs, .doc = "of each combination"});
  visit("shuffle", p.shuffle, {.doc = "in a random order, between two confirmations"});
  visit("seed", p.seed, {.min = 0, .doc = "of that order; the same seed, the same order"});
  visit("wait", p.wait,
        {.doc = "for a condition, at zero field, before each run and after what is confirmed for it"});
  describe(visit, p.rules);
}

// What one run has of its own.
struct Step {
  std::vector<nlohmann::json> values{};  // of the sweeps, one by one
  std::int64_t repeat = 1;
  std::int64_t number = 0;  // in the order without shuffling: its noise is the same wherever it is drawn
};

// What its fields alone do not say. Throws Error(invalid_params) with every problem; their JSON pointers
// begin with `path`.
void demand_valid(const Plan& plan, const std::string& path = "");
// The runs of a valid plan, in their order.
std::vector<Step> steps_of(const Plan& plan);
// What is asked of the engine for one.
RunRequest request_of(const Plan& plan, const Step& step);
// What a person must have done for it: the texts of the sweeps that ask for it, with the values.
// `set_up`: the values that are there, {set: value}. "": nothing.
std::string to_confirm(const Plan& plan, const Step& step, const nlohmann::json& set_up);
// These values.
nlohmann::json setup_of(const Plan& plan, const Step& step);

}  // namespace ferrobench::server
