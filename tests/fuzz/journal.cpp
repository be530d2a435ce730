// Any records, with sound checksums, as a journal: refused, or read and recovered. A record is its kind, its
// rows, the length of its payload (2 bytes), and the payload.
#include "base/error.h"
#include "input.h"
#include "recordings/file/reader.h"
#include "recordings/file/recover.h"
#include "recordings/journal/records.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace ferrobench;
  const auto path = (fuzz::folder() / "fuzz.h5").string();
  auto rest = fuzz::text_of(data, size);
  std::string journal;
  for (std::uint64_t sequence = 0; rest.size() >= 4; ++sequence) {
    const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(rest[i]); };
    const auto kind = static_cast<recordings::RecordKind>(byte(0));
    const std::uint32_t rows = byte(1);
    const std::size_t length = static_cast<std::size_t>(byte(2) << 8 | byte(3));
    const auto payload = rest.substr(4, length);
    rest.remove_prefix(4 + payload.size());
    journal += recordings::encode(kind, sequence, rows, payload);
  }
  fuzz::spill(path + ".journal", journal);
  try {
    recordings::read_summary(path);
    const auto r = recordings::read_recording(path);
    const auto done = recordings::recover_recording(path);
    if (done.outcome == recordings::Recovered::recovered || done.outcome == recordings::Recovered::completed)
      fuzz::demand(recordings::read_recording(path).size() == r.size(), "the rows recovered");
  } catch (const Error&) {
  }
  for (const auto* end : {"", ".journal", ".journal.damaged"}) std::filesystem::remove(path + end);
  return 0;
}
