#include "model/inference/study/discover.h"

#include <chrono>
#include <set>

#include "model/inference/dataset/held_out.h"
#include "model/inference/selection/candidates.h"
#include "model/inference/study/inquiry.h"
#include "recordings/analysis/skew.h"

namespace ferrobench::model {
namespace inference {
namespace {

// Rows of all recordings together: as many as say more than they cost.
constexpr std::size_t rows_together = 40000;

std::string names_of(const Session& s, const std::set<std::size_t>& recordings) {
  std::string out;
  for (const auto i : recordings) out += (out.empty() ? "" : ", ") + s.bench[i].name;
  return out;
}

}  // namespace
}  // namespace inference

Discovery discover(const Model& base, std::vector<NamedRecording> recordings,
                   const DiscoverOptions& options) {
  using namespace inference;
  check_selection(options.selection);
  check_floor(options.floor);
  const auto begin = std::chrono::steady_clock::now();
  Session s(options);
  s.tick("reading the recordings", 0);
  s.candidates = candidates_of(base, options.candidates);
  for (const auto* term : empirical_terms(base)) (term->table ? s.tables : s.corrections).push_back(term);
  check_recordings(recordings);
  s.out.asked = asked_of(base, options);
  for (auto& r : recordings) {
    const auto& h = r.recording.header;
    s.out.asked.sources.push_back({r.name, h.title, h.entry_identifier, h.start_time});
  }
  s.tick("choosing the specimen's past", 0.005);
  choose_unknown_pasts(base, recordings, s);
  for (auto& r : recordings) ferrobench::recordings::remove_skew(r.recording);
  s.bench = prepare_bench(base, recordings, rows_together, s.out.health.warnings, s.watched({}).stop);
  recordings.clear();
  s.noise = estimate_noise(s.bench, s.out.health.warnings);
  summarize_noise(s.bench, s.noise, s.out.health);
  drop_untestable(s);
  const auto as_read = s.out;
  split(s, held_out_by(s));
  settle_unknown_pasts(base, s);
  auto unexplained_held_out = Inquiry(s, base).run();
  if (s.out.verdict == Verdict::nothing_missing && !unexplained_held_out.empty() &&
      options.held_out.empty()) {
    // What is missing shows in those alone, so they are learned from, and others are held out.
    s.out = as_read;
    s.out.health.warnings.push_back("Something seemed to be missing only in " +
                                    names_of(s, unexplained_held_out) +
                                    ", locked away at first: so that was learned from, and others were "
                                    "locked away instead.");
    const auto tick = s.tick;
    s.tick = [tick](const std::string& stage, double f) { tick(stage, 0.95 + 0.05 * f); };
    split(s, choose_held_out(s.bench, unexplained_held_out));
    unexplained_held_out = Inquiry(s, base).run();
  }
  auto& out = s.out;
  if (out.verdict == Verdict::nothing_missing && !unexplained_held_out.empty())
    out.health.warnings.push_back("What was locked away is not explained in " +
                                  names_of(s, unexplained_held_out) +
                                  ": something may be missing that shows only there.");
  out.health.simulations = static_cast<int>(s.simulations);
  out.health.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  s.tick("done", 1);
  return std::move(s.out);
}

}  // namespace ferrobench::model
