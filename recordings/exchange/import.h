// What other programs and testers wrote, as recordings: one for each table. The other way is export.h.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "recordings/exchange/import_csv.h"
#include "recordings/exchange/kind.h"

namespace ferrobench::recordings {

// "-table-03": what its recording's name ends with.
std::string table_suffix(std::size_t number);

// All tables of `import.csv`, in their order; the kind is found where none is given. Testers' files say what
// their columns are, and most of the specimen; what the user gives wins. Error(bad_recording) with line and
// reason, Error(invalid_params) for what the user must say.
std::vector<Imported> import_tables(const CsvImport& import, std::optional<SourceKind> kind,
                                    const Progress& progress = nullptr);

}  // namespace ferrobench::recordings
