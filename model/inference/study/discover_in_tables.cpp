#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>

#include "model/inference/residuals/whitened_tables.h"
#include "model/inference/selection/candidates.h"
#include "model/inference/solver/multifidelity.h"
#include "model/inference/study/discover.h"
#include "model/inference/study/workflow.h"

namespace ferrobench::model {
namespace inference {
namespace {

// Cells are known to 0.5 % at best.
constexpr SimulationOptions fine_for_tables{.tolerance = 1e-4, .domains = 2000, .shift = 7};

// An explanation may leave this share of what it explains: model and published numbers are known no better.
constexpr double table_remainder = 2.5e-3;
// Of fewer cells none is held out, since all of them are needed to tell effects apart.
constexpr std::size_t few_cells = 10;

std::vector<std::string> runs_of(const std::vector<TableCell>& cells) {
  std::vector<std::string> out;
  for (const auto& c : cells)
    if (std::ranges::find(out, c.run) == out.end()) out.push_back(c.run);
  return out;
}

std::vector<std::string> choose_held_out_runs(const std::vector<std::string>& runs,
                                              const std::vector<std::string>& wanted, std::size_t cells) {
  if (!wanted.empty()) {
    check_held_out(wanted, runs);
    return wanted;
  }
  if (runs.size() < 3 || cells < few_cells) return {};
  return {runs[runs.size() / 2]};
}

ChannelFigures rms_by_channel(const std::vector<TableCell>& cells, const std::vector<std::size_t>& chosen,
                              const Eigen::VectorXd& residual) {
  std::map<recordings::Channel, std::pair<double, double>> sums;
  for (const std::size_t i : chosen) {
    auto& [sum, count] = sums[cells[i].channel];
    sum += std::pow(residual[static_cast<Eigen::Index>(i)], 2);
    ++count;
  }
  ChannelFigures out;
  for (const auto& [channel, s] : sums) out[channel] = std::sqrt(s.first / s.second);
  return out;
}

// What is published is the specimen's: faults of the bench are looked for only if they are asked for.
bool of_the_bench(const Effect* effect) {
  return effect->family == Family::drive || is_sensor(effect->family);
}

}  // namespace
}  // namespace inference

Discovery discover_in_tables(const Model& base, const std::vector<std::string>& tables,
                             const DiscoverOptions& options) {
  using namespace inference;
  check_selection(options.selection);
  check_floor(options.floor);
  const auto begin = std::chrono::steady_clock::now();
  const auto tick = ticker(options);
  const int threads = threads_of(options);
  Discovery out;
  out.asked = asked_of(base, options);
  for (const auto& name : tables)
    out.asked.sources.push_back({.name = "table " + name, .title = {}, .identifier = {}, .start_time = {}});
  const PublishedExperiments experiments(tables);
  const auto cells = cells_of(experiments);
  const auto runs = runs_of(cells);
  const auto held_out_runs = choose_held_out_runs(runs, options.held_out, cells.size());
  std::vector<std::size_t> all, train, held_out;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    all.push_back(i);
    (std::ranges::find(held_out_runs, cells[i].run) == held_out_runs.end() ? train : held_out).push_back(i);
  }
  for (const auto& run : runs)
    (std::ranges::find(held_out_runs, run) == held_out_runs.end() ? out.train : out.held_out)
        .recordings.push_back(run);

  auto hypothesis = base_hypothesis(base, {});
  hypothesis.reach = 1;
  std::atomic<std::uint64_t> simulations = 0;
  WhitenedTableCells coarse(experiments, train, watched({}, options, simulations), threads);
  WhitenedTableCells fine(experiments, train, watched(fine_for_tables, options, simulations), threads);
  tick("choosing how finely to simulate", 0.01);
  out.health.numerical_error_over_noise =
      choose_fidelities(coarse, fine, hypothesis, prior_mean(hypothesis), fine_for_tables.domains).error;
  auto selection = options.selection;
  selection.single_effect = true;
  selection.relative_remainder = std::max(selection.relative_remainder, table_remainder);
  auto candidates = candidates_of(base, options.candidates);
  if (options.candidates.empty()) std::erase_if(candidates, of_the_bench);
  const auto found = run_workflow(coarse, fine, hypothesis,
                                  {.candidates = std::move(candidates),
                                   .seed = options.seed,
                                   .most_domains = fine_for_tables.domains,
                                   .selection = selection,
                                   .roughly_fitted = {},
                                   .beyond_effects = {},
                                   .tick = tick},
                                  out.health);
  summarize(found, selection, out);

  tick("the proof", 0.95);
  const WhitenedTableCells whole(experiments, all, fine.simulation(), threads);
  const Eigen::VectorXd before = whole.evaluate(found.base.hypothesis, found.base.z);
  const Eigen::VectorXd after = whole.evaluate(found.after().hypothesis, found.after().z);
  out.train.before = rms_by_channel(cells, train, before);
  out.train.after = rms_by_channel(cells, train, after);
  if (!held_out.empty()) {
    out.held_out.before = rms_by_channel(cells, held_out, before);
    out.held_out.after = rms_by_channel(cells, held_out, after);
  }
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    const auto& c = cells[i];
    out.where.push_back({.recording = c.run,
                         .channel = c.channel,
                         .segment = "table " + c.table + (c.detail.empty() ? "" : ", " + c.detail),
                         .excess = std::abs(before[k])});
    out.cells.push_back({.table = c.table,
                         .published = c.published,
                         .before = c.published.published * std::exp(-c.std * before[k]),
                         .after = c.published.published * std::exp(-c.std * after[k]),
                         .held_out = std::ranges::find(held_out, i) != held_out.end()});
  }
  std::ranges::stable_sort(out.where, std::greater<>(), &Excess::excess);
  out.health.warnings.emplace_back(
      "The bench is published tables: \"noise\" is how well their cells are known, 0.5 % of a stroke and 20 "
      "% "
      "of a creep.");
  out.health.simulations = static_cast<int>(simulations);
  out.health.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  tick("done", 1);
  return out;
}

}  // namespace ferrobench::model
