#include "model/past.h"

#include <algorithm>
#include <cmath>

namespace ferrobench::model {
namespace {

using protocols::FirstState;
using protocols::Past;
using protocols::PastKind;

constexpr Fractions poled_minus{0, 1}, unpoled{1.0 / 3, 1.0 / 3};

// Both mean fractions repeat within this share of the domains: less than a bench sees, and slow relaxation
// never repeats to the last digit. It is the same however finely is simulated, so that a coarse run means the
// same past.
constexpr double repeats = 1e-3;

// In between the three wells are filled in a straight line from a third each.
Fractions partly(double poling) {
  const double third = 1.0 / 3, away = std::abs(poling), rest = third * (1 - away);
  const double more = third + (1 - third) * away;
  return poling < 0 ? Fractions{rest, more} : Fractions{more, rest};
}

// Of the state that levels or cycles begin at.
Fractions first_fractions(const Past& past) {
  switch (past.from.value_or(FirstState::poled_plus)) {
    case FirstState::poled_minus:
      return poled_minus;
    case FirstState::unpoled:
      return unpoled;
    case FirstState::partly_poled:
      return partly(past.poling.value_or(0));
    case FirstState::poled_plus:
      break;
  }
  return {};
}

// What the levels say of the way to the first field: as fast as the fastest of them, or, where none moves, in
// the time of the last.
double time_back(const std::vector<protocols::VisitedLevel>& levels, double to) {
  double from = 0, slew = 0;
  for (const auto& level : levels) {
    slew = std::max(slew, std::abs(level.field - from) / level.seconds);
    from = level.field;
  }
  if (from == to) return 0;
  return slew > 0 ? std::abs(to - from) / slew : levels.back().seconds;
}

void visit(Simulator::State& state, const Past& past, double field) {
  if (past.levels.empty())
    throw Error(ErrorCode::invalid_params, "a past of visited levels needs at least one",
                Problem{.path = "/past/levels", .message = "is empty"});
  const double back = time_back(past.levels, field);
  double time = back;
  for (const auto& level : past.levels) time += level.seconds;
  state.start(0, first_fractions(past), -time);
  for (const auto& level : past.levels) state.play(level.seconds, level.field, {}, {});
  state.play(back, field, {}, {});
  state.begin_recording();
}

void cycle(Simulator::State& state, std::span<const double> time, std::span<const double> field) {
  const auto from = first_fractions(*state.options.past);
  if (time.size() < 2) return state.start(field[0], from);
  double slew = 0;
  for (std::size_t k = 1; k < time.size(); ++k)
    slew = std::max(slew, std::abs(field[k] - field[k - 1]) / (time[k] - time[k - 1]));
  const double back = slew > 0 ? std::abs(field.front() - field.back()) / slew : 0;
  state.start(field[0], from, -most_cycles * (time.back() - time.front() + back));
  const int most = state.followed != nullptr ? state.followed->cycles : most_cycles;
  while (state.cycles < most) {
    const auto before = state.means;
    for (std::size_t k = 1; k < time.size(); ++k) state.play(time[k] - time[k - 1], field[k], {}, {});
    state.play(back, field.front(), {}, {});
    ++state.cycles;
    const double moved =
        std::max(std::abs(state.means.plus - before.plus), std::abs(state.means.minus - before.minus));
    if (state.followed == nullptr && moved < repeats) break;
  }
  state.begin_recording();
}

}  // namespace

std::size_t pieces_played(const Past* past, std::size_t knots) {
  if (past == nullptr) return knots;
  if (past->kind == PastKind::visited) return knots + past->levels.size() + 1;
  return past->kind == PastKind::cycled ? knots + most_cycles * (knots + 1) : knots;
}

void start_after(Simulator::State& state, std::span<const double> knot_time,
                 std::span<const double> knot_field) {
  if (state.options.past != nullptr && state.options.past->kind == PastKind::cycled)
    cycle(state, knot_time, knot_field);
  else
    start_after(state, knot_field[0]);
}

void start_after(Simulator::State& state, double field) {
  const auto* past = state.options.past;
  switch (past == nullptr ? PastKind::unknown : past->kind) {
    case PastKind::unknown:
    case PastKind::poled_plus:
      return state.start(field);
    case PastKind::poled_minus:
      return state.start(field, poled_minus);
    case PastKind::unpoled:
      return state.start(field, unpoled);
    case PastKind::partly_poled:
      return state.start(field, partly(past->poling.value_or(0)));
    case PastKind::visited:
      return visit(state, *past, field);
    case PastKind::cycled:
      throw Error(ErrorCode::invalid_params,
                  "a specimen cannot have been cycled through a program that is not known",
                  Problem{.path = "/past/kind",
                          .given = "cycled",
                          .allowed = {"poled_plus", "poled_minus", "unpoled", "partly_poled", "visited"},
                          .hint = "name the levels that were visited"});
  }
}

}  // namespace ferrobench::model
