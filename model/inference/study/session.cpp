#include "model/inference/study/session.h"

#include <algorithm>

#include "model/inference/dataset/held_out.h"
#include "model/inference/dataset/succession.h"
#include "model/inference/selection/candidates.h"

namespace ferrobench::model::inference {

void drop_untestable(Session& s) {
  if (std::ranges::any_of(s.bench, &BenchRecording::has_command)) return;
  const auto before_monitor = [](const Effect* e) { return acts_before_monitor(*e); };
  for (const auto* e : s.candidates)
    if (before_monitor(e)) s.out.not_testable.emplace_back(e->id);
  std::erase_if(s.candidates, before_monitor);
  std::erase_if(s.tables, before_monitor);
}

void choose_unknown_pasts(const Model& base, std::vector<NamedRecording>& recordings, Session& s) {
  for (const auto& r : recordings) s.data.push_back(prepare(r.recording));
  const auto pasts = likeliest_pasts_as_given(base, s.data, s.watched({}));
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    auto& past = recordings[i].recording.header.past;
    s.out.pasts.push_back({recordings[i].name, pasts[i], !past.known()});
    s.presumed_past = s.presumed_past && (past.known() || pasts[i].kind == protocols::PastKind::poled_plus);
    past = pasts[i];
  }
}

UnknownPasts unknown_pasts(Session& s) {
  std::vector<bool> unknown;
  for (const auto& p : s.out.pasts) unknown.push_back(p.chosen);
  std::vector<std::vector<protocols::Past>> by_succession(s.data.size());
  for (const auto& tables : successions(s.data))
    for (const auto& pasts : tables.hypotheses)
      for (std::size_t t = 0; t < pasts.size(); ++t)
        if (pasts[t].known()) by_succession[tables.recordings[t]].push_back(pasts[t]);
  const auto tick = [&s](const std::string& stage) { s.tick(stage, 0.01); };
  return {s.bench,       s.noise,   s.train, std::move(unknown), std::move(by_succession),
          s.watched({}), s.threads, tick};
}

void tell_pasts(Session& s) {
  for (std::size_t i = 0; i < s.bench.size(); ++i) s.out.pasts[i].past = s.bench[i].header.past;
}

void settle_unknown_pasts(const Model& base, Session& s) {
  if (s.presumed_past) return;
  auto settled = settle_pasts(unknown_pasts(s), base_hypothesis(base, s.bench));
  s.presumed_past = settled.presumed;
  s.start = std::move(settled.z);
  tell_pasts(s);
}

ImprovementTask improvement_task(Session& s, const SimulationOptions& fine) {
  ImprovementTask task{.bench = &s.bench,
                       .noise = &s.noise,
                       .train = s.train,
                       .held_out = s.held_out,
                       .candidates = s.candidates,
                       .corrections = s.corrections,
                       .tables = s.tables,
                       .simulation = fine,
                       .threads = s.threads,
                       .selection = s.selection,
                       .floor = s.options.floor};
  if (std::ranges::none_of(s.out.pasts, &FittedPast::chosen)) return task;
  task.choose_pasts = [&s](const Model& m) { return likeliest_pasts_over_range(m, s.data, s.watched({})); };
  task.set_pasts = [&s](const std::vector<protocols::Past>& pasts) {
    hold_pasts(s.bench, pasts);
    tell_pasts(s);
  };
  return task;
}

void allow_far_search(Session& s, ImprovementTask& task) {
  task.presumed_past = s.presumed_past;
  task.search_bases = [&s, fine = task.simulation](const Model& base, const auto& effects, const auto& errors,
                                                   const auto& ticks) {
    return search_bases(base, effects, recordings_of_search(s.data, s.bench, errors, s.train),
                        {.seed = s.options.seed, .threads = s.threads, .simulation = fine, .tick = ticks});
  };
}

void split(Session& s, const std::vector<bool>& held) {
  s.train.clear();
  s.held_out.clear();
  for (std::size_t i = 0; i < s.bench.size(); ++i) {
    (held[i] ? s.held_out : s.train).push_back(i);
    (held[i] ? s.out.held_out : s.out.train).recordings.push_back(s.bench[i].name);
  }
  s.selection = s.options.selection;
  s.selection.raise_detection(squares_between_programs(s.bench, s.noise, s.train));
}

std::vector<bool> held_out_by(const Session& s) {
  const auto& wanted = s.options.held_out;
  if (wanted.empty()) return choose_held_out(s.bench);
  std::vector<std::string> names;
  for (const auto& r : s.bench) names.push_back(r.name);
  check_held_out(wanted, names);
  std::vector<bool> held;
  held.reserve(names.size());
  for (const auto& name : names) held.push_back(std::ranges::find(wanted, name) != wanted.end());
  return held;
}

}  // namespace ferrobench::model::inference
