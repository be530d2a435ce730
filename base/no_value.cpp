#include "base/no_value.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace ferrobench {

bool is_no_value(std::string_view cell) {
  constexpr std::array<std::string_view, 12> words{"nan",     "-nan",     "nan(ind)", "-nan(ind)",
                                                   "1.#qnan", "-1.#qnan", "1.#ind",   "-1.#ind",
                                                   "1.#inf",  "-1.#inf",  "#n/a",     "ovld"};
  const auto same = [](char a, char b) { return (a >= 'A' && a <= 'Z' ? a - 'A' + 'a' : a) == b; };
  return std::ranges::any_of(words,
                             [&](std::string_view word) { return std::ranges::equal(cell, word, same); });
}

bool marks_an_overload(double value) {
  constexpr double least = 9.9e37;  // no quantity measured here comes near it, in any unit
  return std::abs(value) >= least;
}

}  // namespace ferrobench
