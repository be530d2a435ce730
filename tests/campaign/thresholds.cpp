#include "tests/campaign/thresholds.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <fstream>
#include <iostream>
#include <map>
#include <mutex>
#include <tuple>

#include "model/inference/common/parallel.h"
#include "model/inference/report/discovery_report.h"

namespace ferrobench::campaign {

using model::inference::Threshold;
using nlohmann::json;

namespace {

struct Question {
  int bench = 0;
  const Threshold* threshold = nullptr;  // null: all as they are
  double factor = 1;

  std::string name() const { return threshold == nullptr ? "" : std::string(threshold->name); }
  auto key() const { return std::tuple(bench, name(), factor); }
};

std::vector<json> read_log(const std::string& path) {
  std::vector<json> out;
  std::ifstream in(path);
  for (std::string line; std::getline(in, line);)  // the last one may have been cut off
    if (auto answer = json::parse(line, nullptr, false); answer.is_object()) out.push_back(std::move(answer));
  return out;
}

std::vector<const Threshold*> chosen(const std::vector<std::string>& only) {
  std::vector<const Threshold*> out;
  std::string names;
  for (const auto& threshold : model::inference::thresholds()) {
    names += (names.empty() ? "" : ", ") + std::string(threshold.name);
    if (only.empty() || std::ranges::find(only, threshold.name) != only.end()) out.push_back(&threshold);
  }
  if (!only.empty() && out.size() != only.size())
    throw Error(ErrorCode::invalid_params, "--only wants names of thresholds: " + names);
  return out;
}

// One after another for a bench, so that a log that ends early holds whole benches.
std::vector<Question> questions_of(const ThresholdStudy& study) {
  std::vector<std::tuple<int, std::string, double>> answered;
  for (const auto& a : read_log(study.log))
    answered.emplace_back(a.at("bench"), a.at("threshold"), a.at("factor"));
  std::vector<Question> out;
  const auto add = [&](const Question& q) {
    if (std::ranges::find(answered, q.key()) == answered.end()) out.push_back(q);
  };
  const auto thresholds = chosen(study.only);
  for (int bench = study.first; bench < study.first + study.count; ++bench) {
    add({.bench = bench});
    for (const auto* threshold : thresholds)
      for (const double factor : {0.5, 2.0}) add({bench, threshold, factor});
  }
  return out;
}

// Of the calling thread, which does all the work of a search by one thread.
double processor_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

json answer(const ThresholdStudy& study, const Question& q) {
  auto bench = read_bench(study.benches + "/" + name_of(q.bench));
  model::DiscoverOptions options;
  options.seed = bench.seed;
  options.candidates = bench.candidates;
  options.threads = 1;
  if (q.threshold != nullptr) options.selection = scaled(options.selection, *q.threshold, q.factor);
  const double begin = processor_seconds();
  Outcome outcome;
  try {
    outcome = score(bench, to_json(model::discover(bench.handed, std::move(bench.recordings), options)));
  } catch (const Error& error) {
    outcome = score_error(bench, error.what());
  }
  outcome.seconds = processor_seconds() - begin;
  return {{"bench", q.bench}, {"threshold", q.name()}, {"factor", q.factor}, {"outcome", to_json(outcome)}};
}

}  // namespace

void ask_with_other_thresholds(const ThresholdStudy& study) {
  const auto questions = questions_of(study);
  std::ofstream log(study.log, std::ios::app);
  if (!log) throw Error(ErrorCode::io_error, "cannot write " + study.log);
  const auto begin = std::chrono::steady_clock::now();
  std::mutex mutex;  // over log, output and `done`
  std::size_t done = 0;
  model::inference::in_parallel(questions.size(), study.jobs, [&](std::size_t i) {
    const auto& q = questions[i];
    const auto told = answer(study, q);
    const std::scoped_lock lock(mutex);
    log << told.dump() << std::endl;
    ++done;
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
    const double left =
        spent.count() * static_cast<double>(questions.size() - done) / static_cast<double>(done);
    const auto& o = told.at("outcome");
    std::cout << fmt::format("{} of {}, {:.0f} min left: {} {} {}: {} {} ({:.0f} s)\n", done,
                             questions.size(), left / 60, name_of(q.bench), q.name(), q.factor,
                             o.at("verdict").get<std::string>(), o.at("named").dump(),
                             o.at("seconds").get<double>())
              << std::flush;
  });
}

std::string table_of_thresholds(const std::string& log) {
  std::map<int, json> as_they_are;
  std::map<std::pair<std::string, double>, std::map<int, json>> others;
  for (const auto& a : read_log(log)) {
    const std::string threshold = a.at("threshold");
    if (threshold.empty())
      as_they_are[a.at("bench")] = a.at("outcome");
    else
      others[{threshold, a.at("factor")}][a.at("bench")] = a.at("outcome");
  }
  const auto cell = [&](const std::string& name, double factor) -> std::string {
    const auto found = others.find({name, factor});
    if (found == others.end()) return "not asked";
    int count = 0, changed = 0, lost = 0, won = 0;
    double before = 0, after = 0;
    for (const auto& [bench, now] : found->second) {
      const auto was = as_they_are.find(bench);
      if (was == as_they_are.end()) continue;
      const auto& then = was->second;
      ++count;
      changed += now.at("verdict") != then.at("verdict") || now.at("named") != then.at("named");
      lost += then.at("right").get<bool>() && !now.at("right").get<bool>();
      won += !then.at("right").get<bool>() && now.at("right").get<bool>();
      before += then.at("seconds").get<double>();
      after += now.at("seconds").get<double>();
    }
    if (count == 0) return "not asked";
    return fmt::format("{} of {} ({} lost, {} won), {:.2f}", changed, count, lost, won, after / before);
  };
  std::string out =
      "| threshold | value | halved: answers that change (right ones lost, won), time | doubled |\n"
      "| --- | --- | --- | --- |\n";
  for (const auto& t : model::inference::thresholds()) {
    const std::string name(t.name);
    if (others.contains({name, 0.5}) || others.contains({name, 2.0}))
      out +=
          fmt::format("| `{}` | {:.6g} | {} | {} |\n", name, value_of({}, t), cell(name, 0.5), cell(name, 2));
  }
  return out;
}

}  // namespace ferrobench::campaign
