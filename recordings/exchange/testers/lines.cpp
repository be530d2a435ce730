#include "recordings/exchange/testers/lines.h"

#include <algorithm>
#include <array>
#include <cstdint>

#include "base/fields.h"

namespace ferrobench::recordings {
namespace {

constexpr std::size_t longest_line = 1u << 20;

// 0x80 to 0x9f of code page 1252; 0 is no character.
constexpr std::array<std::uint16_t, 32> upper_controls{
    0x20ac, 0,      0x201a, 0x0192, 0x201e, 0x2026, 0x2020, 0x2021, 0x02c6, 0x2030, 0x0160,
    0x2039, 0x0152, 0,      0x017d, 0,      0,      0x2018, 0x2019, 0x201c, 0x201d, 0x2022,
    0x2013, 0x2014, 0x02dc, 0x2122, 0x0161, 0x203a, 0x0153, 0,      0x017e, 0x0178};

void append_utf8(std::string& out, unsigned code) {
  if (code < 0x80) {
    out += static_cast<char>(code);
  } else if (code < 0x800) {
    out += static_cast<char>(0xc0 | (code >> 6));
    out += static_cast<char>(0x80 | (code & 0x3f));
  } else {
    out += static_cast<char>(0xe0 | (code >> 12));
    out += static_cast<char>(0x80 | ((code >> 6) & 0x3f));
    out += static_cast<char>(0x80 | (code & 0x3f));
  }
}

bool is_utf8(std::string_view bytes) {
  for (std::size_t i = 0; i < bytes.size();) {
    const auto byte = static_cast<unsigned char>(bytes[i]);
    const std::size_t length = byte < 0x80                   ? 1
                               : byte >= 0xc2 && byte < 0xe0 ? 2
                               : (byte & 0xf0) == 0xe0       ? 3
                               : byte >= 0xf0 && byte < 0xf5 ? 4
                                                             : 0;
    if (length == 0 || i + length > bytes.size()) return false;
    const auto follows = [](char c) { return (static_cast<unsigned char>(c) & 0xc0) == 0x80; };
    if (!std::ranges::all_of(bytes.substr(i + 1, length - 1), follows)) return false;
    i += length;
  }
  return true;
}

}  // namespace

Lines::Lines(std::string_view text) : text_(text) {
  if (text_.starts_with("\xff\xfe") || text_.starts_with("\xfe\xff"))
    throw Error(ErrorCode::bad_recording, "the file cannot be read as text",
                Problem{.message = "line 1: is written in UTF-16",
                        .hint = "save it as UTF-8 text, or export it as ASCII"});
  constexpr std::string_view mark = "\xef\xbb\xbf";
  if (text_.starts_with(mark)) end_ = mark.size();
}

bool Lines::next() {
  if (end_ >= text_.size()) return false;
  begin_ = end_;
  const auto rest = text_.substr(begin_);
  const auto length = std::min(rest.find_first_of("\r\n"), rest.size());
  line_ = rest.substr(0, length);
  end_ = begin_ + length;
  if (end_ < text_.size()) end_ += text_.substr(end_).starts_with("\r\n") ? 2 : 1;
  ++number_;
  if (line_.size() > longest_line)
    refuse("is longer than any that a tester writes", line_, "",
           std::to_string(longest_line) + " characters");
  if (const auto at = line_.find('\0'); at != std::string_view::npos)
    refuse("has a byte in it that no text has: the file is damaged", line_.substr(at));
  return true;
}

void Lines::go_back() {
  end_ = begin_;
  --number_;
}

bool Lines::is_blank() const {
  return trimmed(line_).empty();
}

double Lines::share_done() const {
  return text_.empty() ? 1 : static_cast<double>(end_) / static_cast<double>(text_.size());
}

void Lines::refuse(const std::string& message, std::string_view given, const std::string& hint,
                   const nlohmann::json& allowed) const {
  throw Error(ErrorCode::bad_recording, "the file is not what its kind of file should be",
              Problem{.message = "line " + std::to_string(number_) + ": " + message,
                      .given = given.empty() ? nlohmann::json() : nlohmann::json(excerpt(given)),
                      .allowed = allowed,
                      .hint = hint});
}

std::string to_utf8(std::string_view bytes) {
  if (is_utf8(bytes)) return std::string(bytes);
  std::string out;
  for (const char c : bytes) {
    const auto byte = static_cast<unsigned char>(c);
    const unsigned code = byte >= 0x80 && byte < 0xa0 ? upper_controls.at(byte - 0x80) : byte;
    append_utf8(out, code == 0 && byte != 0 ? 0xfffd : code);
  }
  return out;
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view blanks = " \t\r";
  const auto first = text.find_first_not_of(blanks);
  return first == std::string_view::npos ? "" : text.substr(first, text.find_last_not_of(blanks) - first + 1);
}

void split_tabs(std::string_view line, std::vector<std::string_view>& cells) {
  cells.clear();
  while (true) {
    const auto tab = line.find('\t');
    cells.push_back(trimmed(line.substr(0, tab)));
    if (tab == std::string_view::npos) break;
    line.remove_prefix(tab + 1);
  }
  while (cells.size() > 1 && cells.back().empty()) cells.pop_back();
}

}  // namespace ferrobench::recordings
