#include "base/shown_unit.h"

#include <array>
#include <utility>

namespace ferrobench {

std::string shown_unit(std::string_view unit) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 6> letters{
      {{"um", "µm"}, {"uC", "µC"}, {"us", "µs"}, {"Ohm", "Ω"}, {"^2", "²"}, {"^3", "³"}}};
  std::string out;
  const auto begins_word = [&](std::size_t at) {
    return at == 0 || unit[at - 1] == ' ' || unit[at - 1] == '/' || unit[at] == '^';
  };
  for (std::size_t at = 0; at < unit.size();) {
    const auto before = at;
    for (const auto& [ascii, shown] : letters)
      if (unit.substr(at).starts_with(ascii) && begins_word(at)) {
        out += shown;
        at += ascii.size();
        break;
      }
    if (at == before) out += unit[at++];
  }
  return out;
}

}  // namespace ferrobench
