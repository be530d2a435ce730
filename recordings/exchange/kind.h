// Which tester or program wrote a text.
#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <utility>

namespace ferrobench::recordings {

// csv: a table in text; data_values: EasyEXPERT's rows without its header, a table whose columns must be told
enum class SourceKind { aixacct, radiant, easyexpert, data_values, csv };
std::span<const std::pair<SourceKind, std::string_view>> enum_names(SourceKind);
std::optional<SourceKind> source_kind(std::string_view name);
// "a text export of Radiant Vision"
std::string_view what_it_is(SourceKind kind);

// By its first lines. Error(bad_recording) for what is no text, and for a text that is of no kind or of two.
SourceKind detect_kind(std::string_view text);

}  // namespace ferrobench::recordings
