#include "server/queue/plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <set>

#include "base/number_text.h"

namespace ferrobench::server {

using nlohmann::json;

namespace {

constexpr std::size_t most_sweeps = 8;
constexpr std::size_t most_text = 1000;  // of a confirmation, or a name

std::vector<json> values_of(const Sweep& sweep) {
  if (sweep.values) return *sweep.values;
  std::vector<json> out;
  const double from = sweep.from.value(), to = sweep.to.value();
  for (std::int64_t i = 0; i < sweep.count; ++i) {
    const double share = static_cast<double>(i) / static_cast<double>(sweep.count - 1);
    if (i + 1 == sweep.count)
      out.emplace_back(to);  // exactly, whatever pow() makes of it
    else
      out.emplace_back(sweep.spacing == Spacing::linear ? from + share * (to - from)
                                                        : from * std::pow(to / from, share));
  }
  return out;
}

void check_sweep(const Sweep& sweep, const std::string& path, std::vector<Problem>& problems) {
  const auto add = [&](const std::string& place, std::string message, json given, std::string hint) {
    problems.push_back({.path = path + place,
                        .message = std::move(message),
                        .given = std::move(given),
                        .hint = std::move(hint)});
  };
  if (sweep.set.empty()) add("/set", "is empty", nullptr, R"(name a setting, for example "rate")");
  if (sweep.confirm.size() > most_text)
    add("/confirm", "is too long", sweep.confirm.size(), "a sentence will do");
  const bool range = sweep.from || sweep.to;
  if (sweep.values && range)
    return add("", "has values and a range", nullptr, R"(give either "values", or "from", "to" and "count")");
  if (sweep.values) {
    if (sweep.values->empty()) add("/values", "is empty", nullptr, "give one value at least");
    if (sweep.values->size() > most_planned_runs)
      add("/values", "has too many values", sweep.values->size(),
          "a plan has " + std::to_string(most_planned_runs) + " runs at most");
    for (std::size_t i = 0; i < std::min(sweep.values->size(), most_planned_runs); ++i) {
      const auto& value = (*sweep.values)[i];
      if (!value.is_number() && !value.is_string() && !value.is_boolean())
        add("/values/" + std::to_string(i), "is no number, text, true or false", value, "");
      if (problems.size() >= max_problems) return;
    }
    return;
  }
  if (!sweep.from || !sweep.to)
    return add("", "has no values", nullptr, R"(give "values", or "from", "to" and "count")");
  if (sweep.spacing == Spacing::logarithmic && !(*sweep.from * *sweep.to > 0))
    add("/from", "cannot be spaced logarithmically", *sweep.from, "both ends must be above 0, or both below");
}

std::string text_of(const json& value) {
  if (value.is_string()) return value.get<std::string>();
  return value.is_number_float() ? number_text(value.get<double>()) : value.dump();
}

// Every combination of the values of these sweeps, the first one changing slowest.
std::vector<std::vector<std::size_t>> combinations(const std::vector<std::vector<json>>& values,
                                                   const std::vector<std::size_t>& which) {
  std::vector<std::vector<std::size_t>> out{{}};
  for (const auto sweep : which) {
    std::vector<std::vector<std::size_t>> longer;
    for (const auto& begun : out)
      for (std::size_t i = 0; i < values[sweep].size(); ++i) {
        longer.push_back(begun);
        longer.back().push_back(i);
      }
    out = std::move(longer);
  }
  return out;
}

}  // namespace

std::span<const std::pair<Spacing, std::string_view>> enum_names(Spacing) {
  static constexpr std::array<std::pair<Spacing, std::string_view>, 2> names{
      {{Spacing::linear, "linear"}, {Spacing::logarithmic, "logarithmic"}}};
  return names;
}

std::span<const std::pair<Resume, std::string_view>> enum_names(Resume) {
  static constexpr std::array<std::pair<Resume, std::string_view>, 2> names{
      {{Resume::by_operator, "operator"}, {Resume::automatic, "automatic"}}};
  return names;
}

void demand_valid(const Plan& plan, const std::string& path) {
  std::vector<Problem> problems;
  if (plan.format != "ferrobench-plan")
    problems.push_back({.path = path + "/format",
                        .message = "is not that of a plan",
                        .given = excerpt(plan.format),
                        .allowed = "ferrobench-plan"});
  if (plan.name.size() > most_text)
    problems.push_back({.path = path + "/name",
                        .message = "is too long",
                        .given = plan.name.size(),
                        .allowed = {{"to", most_text}},
                        .unit = "bytes"});
  if (!plan.run.request.set.is_object())
    problems.push_back(
        {.path = path + "/run/set", .message = "is not an object", .given = plan.run.request.set});
  if (plan.sweeps.size() > most_sweeps)
    problems.push_back({.path = path + "/sweeps",
                        .message = "are too many",
                        .given = plan.sweeps.size(),
                        .allowed = {{"to", most_sweeps}}});
  if (plan.wait) {
    check_wait(*plan.wait, path + "/wait", problems);
    if (replayed(plan.run.request.device))
      problems.push_back({.path = path + "/wait",
                          .message = "cannot come: a replay measures nothing before it begins",
                          .hint = "leave it out, or choose another device"});
  }
  auto runs = static_cast<double>(plan.repeats);
  std::set<std::string> swept;
  for (std::size_t i = 0; i < plan.sweeps.size() && problems.size() < max_problems; ++i) {
    const auto& sweep = plan.sweeps[i];
    const auto place = path + "/sweeps/" + std::to_string(i);
    check_sweep(sweep, place, problems);
    if (!swept.insert(sweep.set).second)
      problems.push_back({.path = place + "/set", .message = "is swept twice", .given = excerpt(sweep.set)});
    runs *= sweep.values ? static_cast<double>(sweep.values->size()) : static_cast<double>(sweep.count);
  }
  if (runs > most_planned_runs)
    problems.push_back({.path = path + "/sweeps",
                        .message = "make too many runs",
                        .given = runs,
                        .allowed = {{"to", most_planned_runs}},
                        .hint = "make several plans of it"});
  if (!problems.empty()) throw Error(ErrorCode::invalid_params, "the plan is not valid", std::move(problems));
}

std::vector<Step> steps_of(const Plan& plan) {
  std::vector<std::vector<json>> values;
  std::vector<std::size_t> outer, inner;
  for (std::size_t i = 0; i < plan.sweeps.size(); ++i) {
    values.push_back(values_of(plan.sweeps[i]));
    (plan.sweeps[i].confirm.empty() ? inner : outer).push_back(i);
  }
  std::vector<Step> out;
  std::mt19937_64 draw(static_cast<std::uint64_t>(plan.seed));  // the standard says what it gives
  const auto within = combinations(values, inner);
  for (const auto& confirmed : combinations(values, outer)) {
    const auto begin = out.size();
    for (std::int64_t repeat = 1; repeat <= plan.repeats; ++repeat)
      for (const auto& chosen : within) {
        Step step{.values = std::vector<json>(values.size()),
                  .repeat = repeat,
                  .number = static_cast<std::int64_t>(out.size())};
        for (std::size_t i = 0; i < outer.size(); ++i) step.values[outer[i]] = values[outer[i]][confirmed[i]];
        for (std::size_t i = 0; i < inner.size(); ++i) step.values[inner[i]] = values[inner[i]][chosen[i]];
        out.push_back(std::move(step));
      }
    if (plan.shuffle)
      for (std::size_t left = out.size() - begin; left > 1; --left)
        std::swap(out[begin + left - 1], out[begin + draw() % left]);
  }
  return out;
}

RunRequest request_of(const Plan& plan, const Step& step) {
  auto request = plan.run.request;
  for (std::size_t i = 0; i < plan.sweeps.size(); ++i) request.set[plan.sweeps[i].set] = step.values.at(i);
  request.seed += step.number;
  return request;
}

std::string to_confirm(const Plan& plan, const Step& step, const json& set_up) {
  std::string out;
  for (std::size_t i = 0; i < plan.sweeps.size(); ++i) {
    const auto& sweep = plan.sweeps[i];
    const auto found = set_up.find(sweep.set);
    if (sweep.confirm.empty() || (found != set_up.end() && *found == step.values.at(i))) continue;
    auto text = sweep.confirm;
    const auto place = text.find("{}");
    if (place != std::string::npos) text.replace(place, 2, text_of(step.values.at(i)));
    out += (out.empty() ? "" : "; ") + text;
  }
  return out;
}

json setup_of(const Plan& plan, const Step& step) {
  auto out = json::object();
  for (std::size_t i = 0; i < plan.sweeps.size(); ++i)
    if (!plan.sweeps[i].confirm.empty()) out[plan.sweeps[i].set] = step.values.at(i);
  return out;
}

}  // namespace ferrobench::server
