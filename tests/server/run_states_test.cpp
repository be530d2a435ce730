#include "run_states.h"

#include <gmock/gmock.h>

namespace ferrobench::server::states {
namespace {

TEST(RunStates, NoneThatTheModelLacksHoweverManyAsk) {
  const auto figures = play(6000, 4, 1);
  EXPECT_THAT(figures.failures, testing::IsEmpty());
  // Fewer where runs are slow beside calls, as with a sanitizer.
  EXPECT_GT(figures.runs, 3u) << figures;
  EXPECT_GE(figures.transitions.size(), 4u) << figures;
}

TEST(RunStates, NoneThatTheModelLacksThoughTheBenchDies) {
  const auto figures = play(4000, 4, 2, true);
  EXPECT_THAT(figures.failures, testing::IsEmpty());
  EXPECT_GT(figures.runs, 3u) << figures;
  EXPECT_GE(figures.answers.at(std::string(bench_death)), 2) << figures;  // fewer where calls are quick
}

// The judge itself: what a bench must not do is found.
Told told(const std::string& run, RunState state) {
  Told out{.status = {.run = run, .state = state, .output_at_zero = is_over(state)}};
  if (is_over(state)) out.status.ended = "now";
  if (state == RunState::aborted) out.status.reason = "enough";
  if (state == RunState::complete) out.status.progress = 1;
  return out;
}

TEST(RunStates, TheJudgeFindsWhatCannotBe) {
  const auto failures = [](const std::vector<Ask>& asks, const std::vector<Told>& all) {
    Figures figures;
    judge(asks, all, figures);
    return figures.failures.size();
  };
  using enum RunState;
  const Ask start{
      .method = "run.start", .begin = 0, .end = 0.1, .result = {{"run", "a"}, {"state", "arming"}}};
  EXPECT_EQ(failures({start}, {told("a", arming), told("a", running), told("a", complete)}), 0u);
  EXPECT_EQ(failures({start}, {told("a", running), told("a", complete)}), 1u);
  EXPECT_EQ(failures({start}, {told("a", arming), told("a", complete), told("a", running)}), 2u);
  EXPECT_EQ(failures({start}, {told("a", arming), told("a", paused), told("a", complete)}), 2u);
  EXPECT_EQ(failures({start}, {told("a", arming), told("a", aborted)}), 1u);
  EXPECT_EQ(failures({start}, {told("a", arming), told("b", arming)}), 3u);
  auto live = told("a", complete);
  live.status.output_at_zero = false;
  EXPECT_EQ(failures({start}, {told("a", arming), live}), 1u);
  const Ask stop{.method = "run.abort",
                 .params = {{"run", "a"}},
                 .begin = 0.02,
                 .end = 0.05,
                 .result = {{"run", "a"}, {"state", "arming"}}};
  EXPECT_EQ(failures({start, stop}, {told("a", arming), told("a", aborted)}), 0u);
  EXPECT_EQ(failures({start, stop}, {told("a", arming), told("a", complete)}), 1u);

  const Ask lease{.client = 1,
                  .method = "lease.acquire",
                  .params = {{"duration_s", 2}},
                  .begin = 1,
                  .end = 1.1,
                  .result = {{"lease", "x"}}};
  const Ask other{.client = 2, .method = "limits.set", .begin = 1.5, .end = 1.6};
  auto refused = other;
  refused.error = "not_controller";
  EXPECT_EQ(failures({lease, other}, {}), 1u);
  EXPECT_EQ(failures({lease, refused}, {}), 0u);
  EXPECT_EQ(failures({refused}, {}), 1u);
  refused.lease = "x";
  EXPECT_EQ(failures({lease, refused}, {}), 1u);
}

}  // namespace
}  // namespace ferrobench::server::states
