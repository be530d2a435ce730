// What other programs and testers wrote, as recordings: one for each table. The other way is export.h.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "recordings/exchange/import_csv.h"

namespace ferrobench::recordings {

// csv: a table in text; data_values: EasyEXPERT's rows without its header, a table whose columns must be told
enum class SourceKind { aixacct, radiant, easyexpert, data_values, csv };
std::span<const std::pair<SourceKind, std::string_view>> enum_names(SourceKind);
// "a text export of Radiant Vision"
std::string_view what_it_is(SourceKind kind);

// By its first lines. Error(bad_recording) for what is no text, and for a text that is of no kind or of two.
SourceKind detect_kind(std::string_view text);

// "-table-03": what its recording's name ends with.
std::string table_suffix(std::size_t number);

// All tables of `import.csv`, in their order; the kind is found where none is given. Testers' files say what
// their columns are, and most of the specimen; what the user gives wins. Error(bad_recording) with line and
// reason, Error(invalid_params) for what the user must say.
std::vector<Imported> import_tables(const CsvImport& import, std::optional<SourceKind> kind,
                                    const Progress& progress = nullptr);

}  // namespace ferrobench::recordings
