// ferrobench_fuzz_seeds FOLDER: FOLDER/recording, FOLDER/journal and FOLDER/bench, each with inputs for the
// target of that name.
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "recordings/journal/records.h"
#include "tests/faults/damage.h"
#include "tests/server/bench_messages.h"

namespace ferrobench {
namespace {

namespace fs = std::filesystem;

void put(const fs::path& path, std::string_view bytes) {
  fs::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

// The records of a journal without their heads, as the target takes them.
std::string without_heads(std::string_view journal) {
  std::string out;
  while (const auto head = recordings::decode_head(journal.substr(0, recordings::head_bytes))) {
    out += static_cast<char>(head->kind);
    out += static_cast<char>(head->rows);
    out += static_cast<char>(head->bytes >> 8);
    out += static_cast<char>(head->bytes);
    out += journal.substr(recordings::head_bytes, head->bytes);
    journal.remove_prefix(recordings::head_bytes + head->bytes);
  }
  return out;
}

}  // namespace
}  // namespace ferrobench

int main(int argc, char** argv) {
  using namespace ferrobench;
  if (argc != 2) {
    std::fprintf(stderr, "ferrobench_fuzz_seeds FOLDER\n");
    return 2;
  }
  const fs::path folder = argv[1];
  const auto work = folder / "work";
  const auto [recording, plain, journal, csv] = faults::sound_files(work);
  put(folder / "recording" / "checked", recording);
  put(folder / "recording" / "journal", journal);
  put(folder / "journal" / "whole", without_heads(journal));
  int number = 0;
  for (const auto& frame : bench::frames()) put(folder / "bench" / std::to_string(number++), frame);
  fs::remove_all(work);
  return 0;
}
