#include "base/visible.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>

namespace ferrobench {
namespace {

struct Character {
  std::size_t bytes = 0;  // 0: this byte begins no character
  std::uint32_t code = 0;
};

// UTF-8 without detours: each character in its shortest form, no halves of surrogates.
Character first_of(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const auto lead = byte(0);
  if (lead < 0x80) return {1, lead};
  const std::size_t bytes = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
  constexpr std::array<std::uint32_t, 5> smallest{0, 0, 0x80, 0x800, 0x10000};
  if (lead < 0xc2 || lead > 0xf4 || bytes > text.size()) return {};
  std::uint32_t code = lead & (0xffU >> (bytes + 1));
  for (std::size_t i = 1; i < bytes; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return {};
    code = code << 6 | (byte(i) & 0x3fU);
  }
  if (code < smallest.at(bytes) || code > 0x10ffff || (code >= 0xd800 && code < 0xe000)) return {};
  return {bytes, code};
}

bool is_harmful(std::uint32_t code) {
  const auto between = [&](std::uint32_t low, std::uint32_t high) { return code >= low && code <= high; };
  return code < 0x20 || between(0x7f, 0x9f) || between(0x200e, 0x200f) || between(0x2028, 0x202e) ||
         between(0x2066, 0x2069) || code == 0xfeff;
}

std::string spelled_out(std::uint32_t code) {
  if (code == '\n') return "\\n";
  if (code == '\r') return "\\r";
  if (code == '\t') return "\\t";
  std::array<char, 16> text{};
  (void)std::snprintf(text.data(), text.size(), code < 0x100 ? "\\x%02x" : "\\u%04x", code);
  return text.data();
}

}  // namespace

std::string visible(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const auto [bytes, code] = first_of(text);
    if (bytes == 0) {
      out += spelled_out(static_cast<unsigned char>(text[0]));
    } else if (is_harmful(code)) {
      out += spelled_out(code);
    } else {
      out += text.substr(0, bytes);
    }
    text.remove_prefix(std::max<std::size_t>(bytes, 1));
  }
  return out;
}

std::string in_one_line(std::string_view error_text) {
  std::string out;
  for (std::size_t at = 0; at < error_text.size();) {
    const auto end = std::min(error_text.find('\n', at), error_text.size());
    const auto begin = std::min(error_text.find_first_not_of(' ', at), end);
    if (!out.empty()) out += ": ";
    out += error_text.substr(begin, end - begin);
    at = end + 1;
  }
  return out;
}

}  // namespace ferrobench
