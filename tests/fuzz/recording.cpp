// Any bytes as a recording's file: refused, or read, reported and exported. HDF5 files are read in a process
// of their own (recordings/hdf5/read_apart.h), where the library may crash.
#include <sstream>

#include "base/error.h"
#include "input.h"
#include "recordings/exchange/export.h"
#include "recordings/file/reader.h"
#include "recordings/reports/report.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace ferrobench;
  const auto path = (fuzz::folder() / "fuzz.h5").string();
  fuzz::spill(path, fuzz::text_of(data, size));
  try {
    const auto summary = recordings::read_summary(path);
    const auto r = recordings::read_recording(path);
    fuzz::demand(summary.rows == r.size(), "the rows of the summary");
    render(make_report(r), recordings::Format::json);
    std::ostringstream text;
    export_json(r, text);
  } catch (const Error&) {
  }
  return 0;
}
