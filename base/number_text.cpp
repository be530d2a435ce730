#include "base/number_text.h"

#include <array>
#include <charconv>

namespace ferrobench {

std::string number_text(double value) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value == 0 ? 0.0 : value,
                                 std::chars_format::general, 4);
  return {text.data(), end.ptr};
}

std::string number_in_full(double value) {
  std::array<char, 32> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

}  // namespace ferrobench
