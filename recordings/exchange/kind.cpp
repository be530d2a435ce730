#include "recordings/exchange/kind.h"

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "base/delimited_text.h"
#include "base/error.h"
#include "base/fields.h"
#include "recordings/exchange/testers/aixacct.h"
#include "recordings/exchange/testers/easyexpert.h"
#include "recordings/exchange/testers/radiant.h"

namespace ferrobench::recordings {
namespace {

using nlohmann::json;

// What a spreadsheet or a logger writes: at least two of the first lines hold several cells.
bool looks_like_a_table(std::string_view text) {
  constexpr std::size_t looked_at = 1u << 16;
  const auto control = [](char c) {
    return static_cast<unsigned char>(c) < 0x20 && c != '\t' && c != '\r' && c != '\n';
  };
  const auto start = text.substr(0, looked_at);
  if (std::ranges::any_of(start, control)) return false;
  std::vector<Problem> ignored;
  constexpr std::size_t most = 4;
  DelimitedText table(start, {}, "", ignored, most);
  int rows = table.names().empty() ? 0 : 1;
  while (rows < 2 && table.next()) ++rows;
  return rows >= 2;
}

}  // namespace

std::span<const std::pair<SourceKind, std::string_view>> enum_names(SourceKind) {
  static constexpr std::array<std::pair<SourceKind, std::string_view>, 5> names{
      {{SourceKind::aixacct, "aixacct"},
       {SourceKind::radiant, "radiant"},
       {SourceKind::easyexpert, "b1500"},
       {SourceKind::data_values, "datavalue"},
       {SourceKind::csv, "csv"}}};
  return names;
}

std::optional<SourceKind> source_kind(std::string_view name) {
  for (const auto& [kind, known] : enum_names(SourceKind{}))
    if (known == name) return kind;
  return std::nullopt;
}

std::string_view what_it_is(SourceKind kind) {
  switch (kind) {
    case SourceKind::aixacct:
      return "an ASCII export of an aixACCT tester";
    case SourceKind::radiant:
      return "a text export of Radiant Vision";
    case SourceKind::easyexpert:
      return "a CSV export of Keysight EasyEXPERT";
    case SourceKind::data_values:
      return "DataValue rows without a header";
    case SourceKind::csv:
      return "a table in text";
  }
  return "";
}

SourceKind detect_kind(std::string_view text) {
  std::vector<SourceKind> found;
  if (looks_like_aixacct(text)) found.push_back(SourceKind::aixacct);
  if (looks_like_radiant(text)) found.push_back(SourceKind::radiant);
  if (looks_like_easyexpert(text)) found.push_back(SourceKind::easyexpert);
  if (looks_like_data_values(text)) found.push_back(SourceKind::data_values);
  // The first line tells of a tester; what follows may be another one's.
  constexpr std::string_view row = "\nDataValue,", quotes = "\xbb\xbb\xbb";
  const auto add = [&](SourceKind kind, bool seen) {
    if (seen && std::ranges::find(found, kind) == found.end()) found.push_back(kind);
  };
  if (found.size() == 1) {
    const bool easy = found[0] == SourceKind::easyexpert || found[0] == SourceKind::data_values;
    add(SourceKind::data_values, !easy && text.find(row) != std::string_view::npos);
    add(SourceKind::radiant, text.find(quotes) != std::string_view::npos);
  }
  if (found.empty() && looks_like_a_table(text)) found.push_back(SourceKind::csv);
  if (found.size() == 1) return found.front();
  auto allowed = json::array();
  for (const auto& [kind, name] : enum_names(SourceKind{})) allowed.push_back(name);
  std::string seen = text.empty() ? "it is empty" : "it is none of the kinds that are read here";
  for (const auto kind : found) {
    if (kind == found.front())
      seen = "it looks like ";
    else
      seen += ", and like ";
    seen += what_it_is(kind);
  }
  const auto begin = text.substr(0, text.find('\n'));
  throw Error(ErrorCode::bad_recording, "the kind of the file cannot be told",
              Problem{.path = "/as",
                      .message = seen,
                      .given = begin.empty() ? json() : json(excerpt(begin)),
                      .allowed = allowed,
                      .hint = "say which kind it is"});
}

}  // namespace ferrobench::recordings
