#include "base/number_text.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

namespace ferrobench {

namespace {

constexpr int usual_digits = 4;

std::string with_digits(double value, int digits) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value == 0 ? 0.0 : value,
                                 std::chars_format::general, digits);
  return {text.data(), end.ptr};
}

}  // namespace

std::string number_text(double value) {
  return with_digits(value, usual_digits);
}

std::pair<std::string, std::string> interval_text(double low, double high) {
  constexpr int most_digits = 15, of_the_width = 2;
  const double apart = std::max(std::abs(low), std::abs(high)) / std::abs(high - low);
  int digits = usual_digits;
  if (apart > 0 && std::isfinite(apart))
    digits =
        std::clamp(static_cast<int>(std::ceil(std::log10(apart))) + of_the_width, usual_digits, most_digits);
  return {with_digits(low, digits), with_digits(high, digits)};
}

std::string number_in_full(double value) {
  std::array<char, 32> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

}  // namespace ferrobench
