#include "recordings/exchange/conversion/loops_of_tester.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/number_text.h"
#include "recordings/exchange/conversion/checks.h"
#include "recordings/exchange/conversion/units_of_columns.h"

namespace ferrobench::recordings {
namespace {

struct Loop {
  int number = 0;
  const Values* voltage = nullptr;
  const Values* current = nullptr;
  const Values* polarization = nullptr;
  bool measured = false, joined = false;
  double rms = INFINITY;  // of A dP from the integral of I dt, over the range
  std::string name() const { return "P" + std::to_string(number); }
};

const Values* values_of(const TesterTable& table, const std::string& name) {
  const auto* column = table.column(name);
  return column == nullptr ? nullptr : &column->values;
}

std::vector<Loop> loops_of(const TesterTable& table) {
  std::vector<Loop> out;
  for (int k = 1; k <= 9; ++k) {
    const auto number = std::to_string(k);
    Loop loop{.number = k,
              .voltage = values_of(table, k == 3 ? "V-" : "V+"),
              .current = values_of(table, "I" + number),
              .polarization = values_of(table, "P" + number)};
    if (loop.polarization == nullptr) continue;
    loop.measured = loop.voltage != nullptr && is_measured(*loop.polarization) && is_measured(*loop.voltage);
    out.push_back(loop);
  }
  return out;
}

// A tester that shows a closed loop joins the second halves of two runs: one half is another run's current,
// value by value, and the other is not.
bool is_joined(const Loop& loop, const Loop& other) {
  if (loop.current == nullptr || other.current == nullptr) return false;
  const auto& a = *loop.current;
  const auto& b = *other.current;
  const auto half = static_cast<std::ptrdiff_t>(a.size() / 2);
  return a != b && std::equal(a.begin() + half, a.end(), b.begin() + half);
}

// Columns of other loops that say what the taken one's do, value by value.
void drop_repeated(TesterTable& table, const std::vector<Loop>& loops, const Loop& best) {
  std::vector<std::string> repeated;
  for (const auto& loop : loops)
    for (const std::string what : {"I", "P", "D"}) {
      const auto name = what + std::to_string(loop.number);
      const auto* mine = values_of(table, name);
      const auto* taken = values_of(table, what + std::to_string(best.number));
      if (loop.number != best.number && mine != nullptr && taken != nullptr && *mine == *taken)
        repeated.push_back(name);
    }
  std::erase_if(table.columns, [&repeated](const TesterColumn& c) {
    return std::ranges::find(repeated, c.name) != repeated.end();
  });
}

}  // namespace

void take_tester_loop(TesterTable& table, Measured& m) {
  m.time = demand_column(table, "Time", Quantity::time);
  auto loops = loops_of(table);
  const Loop* best = nullptr;
  for (auto& loop : loops) {
    if (!loop.measured) continue;
    for (const auto& other : loops)
      loop.joined = loop.joined || (other.number < loop.number && is_joined(loop, other));
    if (loop.current != nullptr) {
      // Units do not matter for how closely one follows the other.
      const auto found = agreement(m.time, *loop.current, *loop.polarization, m.area, {});
      if (found) loop.rms = found->rms;
    }
    constexpr double clearly = 1e-3;
    const bool closer = best != nullptr && best->joined == loop.joined && loop.rms < best->rms - clearly;
    if (closer)
      m.say("warning", best->name() + " does not follow its current (by " + number_text(100 * best->rms) +
                           " % of its range, rms), so " + loop.name() + " is preferred");
    if (best == nullptr || (best->joined && !loop.joined) || closer) best = &loop;
  }
  if (best == nullptr) {
    m.voltage = demand_column(table, "V+", Quantity::voltage);  // says what there is
    m.current = take_column(table, "I1", Quantity::current);
  } else {
    std::string text = best->name() + " is taken, with " + (best->number == 3 ? "V-" : "V+");
    for (const auto& loop : loops) {
      if (loop.number == best->number) continue;
      const bool same = loop.measured && *loop.polarization == *best->polarization;
      text += "; " + loop.name() +
              (!loop.measured ? " was not measured"
               : same         ? " is the same"
               : loop.joined  ? " is joined from the halves of two runs"
                              : " is another run, which goes along");
    }
    if (loops.size() > 1) m.say("note", "of the table's loops " + text);
    const auto number = std::to_string(best->number);
    const bool reverse = best->number == 3;
    drop_repeated(table, loops, *best);
    m.voltage = demand_column(table, reverse ? "V-" : "V+", Quantity::voltage);
    m.polarization = take_column(table, "P" + number, Quantity::polarization);
    m.current = take_column(table, "I" + number, Quantity::current);
    if (auto displacement = take_column(table, "D" + number, Quantity::displacement);
        displacement && is_measured(*displacement))
      m.channel(Channel::displacement) = std::move(displacement);
  }
}

}  // namespace ferrobench::recordings
