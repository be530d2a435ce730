// Any text as a table of samples: refused, or a recording with a time that rises.
#include "input.h"
#include "recordings/exchange/import_csv.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace ferrobench;
  recordings::CsvImport import;
  import.csv = fuzz::text_of(data, size);
  import.time = {.column = "t"};
  import.field = {.column = "E", .scale = 1e6};
  import.charge = {.column = "Q"};
  import.length = 0.01, import.area = 2.5e-5, import.layer_thickness = 1e-4;
  try {
    const auto r = recordings::import_csv(import);
    fuzz::demand(r.size() >= 2, "there are rows");
    for (std::size_t i = 1; i < r.size(); ++i) fuzz::demand(r.time[i] > r.time[i - 1], "the time rises");
    for (const auto& segment : r.segments)
      fuzz::demand(segment.start_sample >= 0 && segment.end_sample <= static_cast<std::int64_t>(r.size()),
                   "a segment is inside");
  } catch (const Error&) {
  }
  return 0;
}
